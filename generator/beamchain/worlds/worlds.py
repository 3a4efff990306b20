"""`worlds`: many copies of one compiled spacecraft, each with fields of its own,
stepped together."""

from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any, NoReturn, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from beamchain import Embedded, latch, retime, unlatch
from beamchain.checks import finite_array, of_type, one_of, positive, unknown, whole_number
from beamchain.errors import InputError
from beamchain.results import Latched, Retimed
from beamchain.toolkit import (
    LATCH_FIELDS,
    Array,
    Fields,
    Source,
    compile_model,
    ctrl_bounds,
    gravity_of,
    is_latched,
    is_mark,
    joint_request,
    limp_cautions,
    modal_tendons,
    mujoco,
    one_thread,
    runs_exact,
    source_of,
    take_out_latch,
    timing_marks,
    with_fields,
)
from beamchain.worlds.hosts import HOSTS, LARGEST, available, bytes_of, check_memory, host_of
from beamchain.worlds.observation import Observer, mean_rate

MOST = 10**12  # worlds that are counted; memory ends long before
MOST_SEED = 2**128  # of NumPy's generator
COPIES = 3  # that NumPy holds of a world's numbers for a moment
Done = TypeVar("Done")
KEPT = (
    "before",
    "attitude",
    "rate",
    "keys",
)  # arrays that a checkpoint holds beside the simulation


@one_thread()
def make(
    model: "Embedded | mujoco.MjModel | str | Path",
    variants: Any = None,
    count: int | None = None,
    host: str = "mujoco",
    *,
    timestep: float | None = None,
    observe: Sequence[str] | None = None,
    threads: int = 0,
    seed: int = 0,
) -> "Worlds":
    """Simulate many copies of one spacecraft together, each with properties of its own.

    Args:
        model: what `bc.embed` gave, a compiled model, MJCF text or a path.
        variants: what differs between the worlds: the result of `bc.sweep`, arrays `(k, ...)` by
            the name of MuJoCo's field, or half widths relative to the nominal modes, `{"frequency":
            0.05, "damping": 0.3}`, of which every mode of every world draws for itself, uniformly.
            None: nothing differs.
        count: number of worlds; default: one per variant. Fewer variants are used in turn.
        host: "mujoco" (threads of this machine), "mjx" (JAX: `pip install 'beamchain[mjx]'`) or
            "warp" (NVIDIA Warp: `pip install 'beamchain[warp]'`).
        timestep: make every world exact in time for this step [s], and run at it; default: the
            model as it is. Where the model is exact in time already, modes that are drawn are made
            exact for its own step. As `bc.retime` does; a model without modal tendons, such as a
            rigid twin, only runs at the step.
        observe: names of what `step` returns; default: all that the model has of "attitude",
            "rate", "wheels", "modes" and the names of its sensors.
        threads: of the host "mujoco"; 0: as many as the machine has, one for a few worlds.
        seed: of the draws; the same seed gives the same worlds.

    Raises:
        InputError: the host is unknown or not installed, the variants do not fit the model,
            or the worlds do not fit in memory.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import worlds
        >>> craft = '''<mujoco><option timestep="0.25"/><worldbody><body name="bus"><freejoint/>
        ... <inertial pos="0 0 0" mass="300" diaginertia="90 90 90"/>
        ... <site name="mount" pos="0.5 0 0"/></body></worldbody>
        ... <actuator><motor name="z" site="mount" gear="0 0 0 0 0 1"/></actuator></mujoco>'''
        >>> section = bc.Equivalent(bending_stiffness_xy=2e3, linear_mass=4.0)
        >>> spec = bc.Spec(segment=(bc.Segment(length=8.0, section=section),))
        >>> flexible = bc.embed(craft, {"mount": spec}, retime=True)
        >>> many = worlds.make(flexible, {"frequency": 0.05, "damping": 0.3}, count=16)
        >>> seen = many.step([1.0])
        >>> {name: values.shape for name, values in seen.items()}
        {'attitude': (16, 4), 'rate': (16, 3), 'modes': (16, 4)}
    """
    compiled = with_fields(model.model if isinstance(model, Embedded) else compile_model(model), {})
    one_of("host", host, HOSTS)
    if timestep is not None:
        compiled.opt.timestep = positive("timestep", timestep, "s")
    step = float(compiled.opt.timestep)
    timed = any(mark is not None for mark in timing_marks(compiled))  # under RK4 too
    band = None
    if isinstance(model, Embedded):
        band = joint_request([a.spec for a in model.appendages]).band
    given, timing = with_fields(compiled, {}), None
    if timestep is not None and modal_tendons(compiled).names:
        timing = retime(compiled, step, band=band)
    exact_for = step if timed or timestep is not None else None
    source = source_of(given, compiled, variants, exact_for, band)
    size = None if source is None else source.size
    if count is None and size is None:
        raise InputError("count is missing: say how many worlds to make, for example count=64.")
    whole_number("threads", threads, 0, 4096)
    whole_number("seed", seed, 0, MOST_SEED)
    number = whole_number("count", size if count is None else count, 1, MOST)
    return Worlds(
        model=compiled,
        count=number,
        host=host,
        source=source,
        observe=observe,
        threads=threads,
        seed=seed,
        band=band,
        timing=timing,
    )


class Worlds:
    """Worlds that are stepped together, made by `worlds.make`.

    A model that is exact in time is given the mean of this and the last input in the first step
    over which an input is held, so that every sampled position is that of an input held over the
    step. Worlds that diverge are started again, and listed in `diverged`; the others go on.

    Attributes beside the properties are `model`, the nominal one, with its step; `count`, the
    number of worlds; `fields`, arrays `(count, ...)` by the name of MuJoCo's field that differs
    between worlds, to be read only; `diverged` `(n,)`, the numbers of the worlds that diverged in
    the last `step`; and `restarts` `(count,)`, how often each has diverged.

    Args:
        model: compiled, with its step; what is the same in all worlds.
        count: number of worlds.
        host: name of what steps them.
        source: where their fields come from; None: all are the same.
        observe: names of what is read; None: all.
        threads: of the host "mujoco".
        seed: of the draws.
        band: up to where timing of trees keeps the response [rad/s]; None: as `bc.retime` has it.
        timing: what `bc.retime` gave of the model; None: it was left as it is.

    Example:
        >>> import beamchain as bc
        >>> from beamchain import worlds
        >>> from importlib.resources import files
        >>> shipped = files("beamchain") / "examples"
        >>> arrays = {"left": shipped / "array.toml", "right": shipped / "array.toml"}
        >>> flexible = bc.embed(shipped / "satellite.xml", arrays, retime=True)
        >>> many = worlds.make(flexible, {"frequency": 0.05}, count=4)
        >>> seen = many.reset([0, 1], draw=True)  # two of them, with new modes
        >>> kept = many.state()
        >>> seen = many.step(
        ...     [0.1, 0.0, 0.0], nstep=8
        ... )  # N m on the wheels of all, for 8 steps of 0.125 s
        >>> seen["rate"].shape, many.timestep, many.model_of(2).nv == many.model.nv
        ((4, 3), 0.125, True)
        >>> seen = many.restore(kept)
        >>> many.retime(0.25)  # the same modes at another step, from rest
    """

    def __init__(
        self,
        model: "mujoco.MjModel",
        count: int,
        host: str,
        source: Source | None,
        observe: Sequence[str] | None,
        threads: int,
        seed: int,
        band: float | None = None,
        timing: Retimed | None = None,
    ) -> None:
        self._band = band
        self._timing = timing
        #: compiled, with its step; what is the same in all worlds
        self.model: Any = model
        #: number of worlds
        self.count: int = count
        self.rng: np.random.Generator = np.random.default_rng(seed)
        self._source = source
        self._observer = Observer(model, observe)
        self._made = host, threads
        each = 8 * (model.nq + model.nv + model.nu + len(KEPT)) + (source.nbytes if source else 0)
        check_memory(count, COPIES * each + bytes_of(host, model), available())
        #: worlds that diverged in the last step
        self.diverged: NDArray[np.intp] = np.zeros(0, dtype=np.intp)
        #: per world, how often it has diverged
        self.restarts: NDArray[np.int64] = np.zeros(count, dtype=np.int64)
        self._keys = source.keys(count, self.rng, first=True) if source else np.zeros((count, 0))
        self._build()

    def __reduce__(self) -> NoReturn:
        """Worlds hold threads and a simulation; what can be kept is `state()`."""
        raise TypeError(
            "worlds cannot be pickled or copied; make them with worlds.make inside each "
            "process, and keep state(), which can be pickled and which restore() of such worlds "
            "takes."
        )

    @property
    def timestep(self) -> float:
        """[s]."""
        return float(self.model.opt.timestep)

    @property
    def wheels(self) -> list[int]:
        """Actuators that turn a wheel: a leaf body on a hinge without limits,
        the order of `observe()["wheels"]`."""
        return self._observer.wheels

    @property
    def qpos(self) -> Array:
        """`(count, nq)` positions now."""
        return self._host.qpos.copy()

    @property
    def qvel(self) -> Array:
        """`(count, nv)` rates now; of a model exact in time the means over the last step."""
        return self._host.qvel.copy()

    @property
    def mode_names(self) -> tuple[str, ...]:
        """Names of the modal tendons: the columns of `observe()["modes"]` and of `drawn`."""
        return self._observer.mode_names

    @property
    def drawn(self) -> dict[str, Array]:
        """What differs between the worlds now, with the worlds in rows; empty where nothing does.

        Of ranges on modes "frequency" and "damping" `(count, n)`: factors on the nominal
        frequencies and damping ratios, in the order of `mode_names`. Of a sweep "row" `(count,)`,
        the number of the variant, and each of its quantities `(count,)` by name. Of arrays "row".
        """
        return {} if self._source is None else self._source.drawn(self._keys)

    @property
    def warnings(self) -> list[str]:
        """What a user of these worlds must know, each sentence with its `code`: modes that are too
        fast for `timestep` and were slowed (of the nominal model), liquids without weight."""
        timing = [] if self._timing is None else self._timing.warnings
        if np.any(gravity_of(self.model) != 0.0):
            return timing
        why = "no gravity acts in these worlds, and only a thrust in ctrl presses it down"
        return timing + limp_cautions(self.model, why)

    # -- running -----------------------------------------------------------------------------------
    def step(self, ctrl: ArrayLike, nstep: int = 1) -> dict[str, Array]:
        """Hold an input `ctrl` `(count, nu)`, or `(nu,)` for all worlds, over `nstep` steps.
        Returns what `observe` does. An input beyond `ctrlrange` counts as the end of the range.

        Raises:
            InputError: the input has another shape, or is not finite.
        """
        given = _for_worlds("ctrl", ctrl, (self.count, self.model.nu))
        # cut before the mean is formed: MuJoCo itself would cut the mean
        now = np.clip(given, *self._bounds)
        nstep = whole_number("nstep", nstep, 1, MOST)
        first = (now + self._before) / 2.0 if self._half else now
        bad = self._host.step(first, now, nstep)
        self._before = now
        attitude = self._observer.attitude(self._host.qpos)
        self._rate = mean_rate(self._attitude, attitude, nstep * self.timestep)
        self._attitude = attitude
        self.diverged = np.flatnonzero(bad)
        if self.diverged.size:
            self.restarts[self.diverged] += 1
            self._set_free(self.diverged)
            self._restart(self.diverged, self.model.qpos0, np.zeros(self.model.nv))
        return self.observe()

    def observe(self) -> dict[str, Array]:
        """What is observed now, by name, with the worlds in rows.

        "attitude": quaternion of the spacecraft, scalar first. "rate": mean rate over the last
        `step`, in body axes, as an integrating gyro measures it [rad/s]. "wheels": rates of driven
        hinges without limits [rad/s]. "modes": amplitudes of the modal tendons. Sensors by name.
        """
        host = self._host
        return self._observer.read(host.qpos, host.qvel, host.sensors, self._attitude, self._rate)

    def reset(
        self,
        ids: ArrayLike | None = None,
        *,
        qpos: ArrayLike | None = None,
        qvel: ArrayLike | None = None,
        draw: bool = False,
        seed: int | None = None,
    ) -> dict[str, Array]:
        """Start worlds again, their hinges unlatched. Returns what `observe` does.

        Args:
            ids: numbers of the worlds, or a mask `(count,)`; None: all.
            qpos: `(nq,)` or one per world `(n, nq)`; default: the model's own.
            qvel: `(nv,)` or one per world `(n, nv)`; default: at rest.
                Of a model exact in time see `bc.start_velocity`.
            draw: give these worlds new properties.
            seed: start the draws anew.

        Raises:
            InputError: there is no such world, or shapes do not fit.
        """
        which = self._ids(ids)
        start = self.model.qpos0 if qpos is None else qpos
        moving = np.zeros(self.model.nv) if qvel is None else qvel
        place = _for_worlds("qpos", start, (which.size, self.model.nq))
        self._observer.check_places(place)
        rate = _for_worlds("qvel", moving, (which.size, self.model.nv))
        if seed is not None:
            self.rng = np.random.default_rng(whole_number("seed", seed, 0, MOST_SEED))
        self._set_free(which)
        if draw and self._source is not None:
            self._keys[which] = self._source.keys(which.size, self.rng)
            self._write_fields(which)
        self._restart(which, place, rate)
        return self.observe()

    @one_thread()
    def retime(self, timestep: float) -> None:
        """Make every world exact in time for another `timestep` [s], each for its own modes,
        and start all again."""
        model = with_fields(self.model, {})
        model.opt.timestep = positive("timestep", timestep, "s")
        if modal_tendons(model).names:
            self._timing = retime(model, float(timestep), band=self._band)
        self.model = model
        if self._source is not None:
            self._source = self._source.at(model)
        self._build()

    @one_thread()
    def latch(
        self,
        joint: str,
        ids: ArrayLike | None = None,
        *,
        angle: float | None = None,
        stiffness: float | None = None,
        damping: float | None = None,
        armature: float | None = None,
        impact: bool = False,
    ) -> list[Latched | None]:
        """`bc.latch` in every world for itself; of the host "mujoco" only.

        Call it before every step. A world whose next step reaches the angle makes that step here,
        shortened, under the input that it was given last, so that the clocks of the worlds then
        differ by less than a step. Worlds in which the hinge is latched already are left alone.

        Args:
            joint: name of a hinge.
            ids: numbers of the worlds, or a mask `(count,)`; None: all.
            angle, stiffness, damping, armature, impact: as of `bc.latch`.

        Returns:
            For each of these worlds the energy that was dropped [J], or None.

        Raises:
            InputError: the host is another one, or as `bc.latch`.

        Example:
            >>> import beamchain as bc
            >>> from beamchain import worlds
            >>> panel = '''<mujoco><option timestep="0.01" gravity="0 0 0" integrator="RK4"/>
            ... <worldbody><body><freejoint/><inertial pos="0 0 0" mass="50" diaginertia="9 9 9"/>
            ... <body><joint name="hinge" axis="0 0 1" stiffness="2" springref="100" range="0 90"/>
            ... <inertial pos="1 0 0" mass="2" diaginertia=".1 .2 .2"/></body></body></worldbody>
            ... </mujoco>'''
            >>> many = worlds.make(panel, {"jnt_stiffness": [[0.0, 2.0], [0.0, 3.0]]})
            >>> times = {}
            >>> while not many.latched("hinge").all():
            ...     for world, done in enumerate(many.latch("hinge", stiffness=500.0)):
            ...         if done is not None:
            ...             times[world] = round(done.time, 4)
            ...     seen = many.step([])
            >>> times
            {1: 1.1128, 0: 1.3629}
        """

        def done(model: "mujoco.MjModel", data: "mujoco.MjData") -> Latched | None:
            return latch(
                model,
                data,
                joint,
                angle=angle,
                stiffness=stiffness,
                damping=damping,
                armature=armature,
                impact=impact,
            )

        which = self._ids(ids)
        held = self.latched(joint)
        return [None if held[world] else self._in_world(int(world), done) for world in which]

    @one_thread()
    def unlatch(self, joint: str, ids: ArrayLike | None = None) -> list[float]:
        """`bc.unlatch` in some worlds; the energies that it brings [J].

        Args:
            joint: name of a hinge that is latched in all of them.
            ids: numbers of the worlds, or a mask `(count,)`; None: all.

        Raises:
            InputError: the host is another one, or as `bc.unlatch`.
        """
        self._check_latches()

        def brought(model: "mujoco.MjModel", data: "mujoco.MjData") -> float:
            return unlatch(model, data, joint)

        return [self._in_world(int(world), brought) for world in self._ids(ids)]

    def latched(self, joint: str) -> NDArray[np.bool_]:
        """`(count,)` in which worlds a hinge is latched.

        Args:
            joint: its name.

        Raises:
            InputError: the host is another one than "mujoco", or there is no such joint.
        """
        self._check_latches()
        names = {self.model.joint(j).name: j for j in range(self.model.njnt)}
        if joint not in names:
            raise unknown("hinge", joint, [name for name in names if name])
        place = names[joint]
        marks = self.fields.get("jnt_solimp")
        if marks is None:
            return np.full(self.count, is_latched(self.model, place))
        return np.array([is_mark(values[place]) for values in marks], dtype=np.bool_)

    def response(self) -> Callable[..., dict[str, Any]]:
        """One world's response as a function that JAX can differentiate, map and compile;
        of the host "mjx" only.

        The function takes inputs `(t, nu)`, one per step, and optionally `frequency` `(n,)` [rad/s]
        and `damping` `(n,)`, ratios of the modes of the held appendages in the order of
        `observe()["modes"]`. It gives "attitude" `(t, 4)`, "rate" `(t, 3)`, "wheels" and "modes"
        `(t, n)` from rest, after every step. The modes are exact in time where the model is (form
        2), so that a derivative goes through stiffness, damping and armature of the tendons. Use
        doubles: `jax.config.update("jax_enable_x64", True)`.

        Raises:
            InputError: the host is another one, or the model has no modal tendons.
        """
        if self._made[0] != "mjx":
            raise InputError(
                f"host = {self._made[0]!r} has no derivatives; make the worlds with host='mjx'."
            )
        module: Any = import_module("beamchain.worlds.mjx_host")
        return module.response(self.model, self._observer.moved)

    # -- single worlds, checkpoints ----------------------------------------------------------------
    def model_of(self, world: int) -> "mujoco.MjModel":
        """The model of one world, for anything that takes a compiled model: `bc.plant`,
        `bc.linearise`, a picture."""
        world = whole_number("world", world, 0, self.count - 1)
        return with_fields(
            self.model, {name: values[world] for name, values in self.fields.items()}
        )

    def state(self) -> dict[str, Any]:
        """Everything that the worlds continue from: a checkpoint for `restore`, kept with
        pickle."""
        out: dict[str, Any] = {name: getattr(self, f"_{name}").copy() for name in KEPT}
        out |= {"simulation": self._host.state(), "draws": self.rng.bit_generator.state}
        latches = {name: self.fields[name].copy() for name in LATCH_FIELDS if name in self.fields}
        return out | {"timestep": self.timestep, "latches": latches}

    def restore(self, state: Mapping[str, Any]) -> dict[str, Array]:
        """Continue from a checkpoint of these worlds, what `state()` gave.
        Returns what `observe` does.

        Raises:
            InputError: the checkpoint is that of other worlds.
        """
        of_type("state", state, Mapping, "what state() of these worlds gave")
        sizes = [np.shape(state.get(name, 0)) == getattr(self, f"_{name}").shape for name in KEPT]
        if not all(sizes) or state.get("timestep") != self.timestep:
            raise InputError(
                "state is not a checkpoint of these worlds: their number, draws or step differ."
            )
        for name in KEPT:
            setattr(self, f"_{name}", np.array(state[name]))
        self.rng.bit_generator.state = state["draws"]
        every = self._ids(None)
        self._set_free(every)
        self._write_fields(every)
        self._replace_fields(state["latches"], every)
        self._host.restore(state["simulation"])
        return self.observe()

    # -- inside ------------------------------------------------------------------------------------
    def _build(self) -> None:
        """The host with all worlds, at rest."""
        host, threads = self._made
        self._half = runs_exact(self.model)
        scratch = with_fields(self.model, {})
        self._scratch = scratch, mujoco.MjData(scratch)
        self._host = host_of(host, self.model, self.count, threads, self._observer.stage)
        #: by name of MuJoCo's field that differs between worlds, `(count, ...)`
        self.fields: Fields = {}
        self._bounds = ctrl_bounds(self.model)
        self._before = np.zeros((self.count, self.model.nu))
        self._attitude = np.zeros((self.count, 4))
        self._rate = np.zeros((self.count, 3))
        every = self._ids(None)
        self._write_fields(every)
        self._restart(every, self.model.qpos0, np.zeros(self.model.nv))

    def _write_fields(self, which: NDArray[np.intp]) -> None:
        """The fields that follow from the keys of some worlds."""
        if self._source is None:
            return
        new = self._source.fields(self._keys[which])
        for name, values in new.items():
            if name not in self.fields:
                self.fields[name] = np.empty((self.count, *values.shape[1:]), values.dtype)
            self.fields[name][which] = values
        if "actuator_ctrlrange" in new:
            self._bounds = ctrl_bounds(self.model, self.fields["actuator_ctrlrange"])
        if "wrap_prm" in new:
            self._observer.follow(self.fields["wrap_prm"])
        self._host.write_fields(new, which)

    def _replace_fields(self, new: Fields, which: NDArray[np.intp]) -> None:
        """Fields `(n, ...)` of some worlds, in addition to those that differ already."""
        for name, values in new.items():
            if name not in self.fields:
                nominal = np.asarray(getattr(self.model, name))
                self.fields[name] = np.repeat(nominal[None], self.count, axis=0)
            self.fields[name][which] = values
        self._host.write_fields(new, which)

    # -- latches -----------------------------------------------------------------------------------
    def _check_latches(self) -> None:
        if self._made[0] != "mujoco":
            raise InputError(
                f"host = {self._made[0]!r} compiles the stops of hinges into its program, so that "
                "no hinge can latch there; make the worlds with host='mujoco'."
            )

    def _in_world(
        self, world: int, act: "Callable[[mujoco.MjModel, mujoco.MjData], Done]"
    ) -> "Done":
        """Do something to the model and the state of one world."""
        model, data = self._scratch
        for name, values in self.fields.items():
            getattr(model, name)[:] = values[world]
        host: Any = self._host
        host.load(world, model, data)
        data.ctrl[:] = self._before[world]
        mujoco.mj_forward(model, data)  # accelerations of this world
        before = [np.array(getattr(model, name)) for name in LATCH_FIELDS]
        done = act(model, data)
        after = {name: np.array(getattr(model, name))[None] for name in LATCH_FIELDS}
        which = np.array([world])
        if any(np.any(a != b) for a, b in zip(after.values(), before, strict=True)):
            self._replace_fields(after, which)
            host.store(world, model, data)
            self._attitude[which] = self._observer.attitude(self._host.qpos)[which]
        return done

    def _set_free(self, which: NDArray[np.intp]) -> None:
        """Undo every latch in some worlds."""
        if "jnt_solimp" not in self.fields:
            return
        model = self._scratch[0]
        for world in which:
            for name in LATCH_FIELDS:
                getattr(model, name)[:] = self.fields[name][world]
            free = [j for j in range(model.njnt) if is_latched(model, j)]
            for joint in free:
                take_out_latch(model, joint)
            if free:
                new = {name: np.array(getattr(model, name))[None] for name in LATCH_FIELDS}
                self._replace_fields(new, np.array([world]))

    def _restart(self, which: NDArray[np.intp], qpos: Array, qvel: Array) -> None:
        self._host.reset(which, qpos, qvel)
        self._before[which] = 0.0
        self._attitude[which] = self._observer.attitude(self._host.qpos)[which]
        self._rate[which] = self._observer.spin(self._host.qvel)[which]

    def _ids(self, ids: ArrayLike | None) -> NDArray[np.intp]:
        if ids is None:
            return np.arange(self.count)
        given = np.atleast_1d(ids)
        if given.dtype == np.bool_ and given.shape == (self.count,):
            return np.flatnonzero(given)
        whole = given.dtype.kind in "iu" or not given.size
        if given.ndim != 1 or not whole or np.any((given < 0) | (given >= self.count)):
            raise InputError(
                f"ids = {ids!r:.60} names no worlds; give whole numbers from 0 to "
                f"{self.count - 1}, or a mask."
            )
        return given.astype(np.intp)


def _for_worlds(name: str, value: ArrayLike, shape: tuple[int, int]) -> Array:
    """Finite numbers `(k, n)`, those given as `(n,)` the same for all worlds."""
    most = LARGEST if name == "ctrl" else np.inf  # MuJoCo takes no more for zero
    return np.array(np.broadcast_to(finite_array(name, value, shape, shape[1:], most=most), shape))

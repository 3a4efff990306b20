"""What beamchain uses of MuJoCo, which ships no types."""

from typing import Any

from numpy import float64
from numpy.typing import NDArray

__version__: str

class FatalError(Exception): ...

class mjtIntegrator:
    mjINT_EULER: mjtIntegrator
    mjINT_RK4: mjtIntegrator
    mjINT_IMPLICIT: mjtIntegrator
    mjINT_IMPLICITFAST: mjtIntegrator
    mjINT_DISCRETE: mjtIntegrator
    def __int__(self) -> int: ...

class mjtTrn:
    mjTRN_JOINT: mjtTrn
    def __int__(self) -> int: ...

class mjtObj:
    mjOBJ_GEOM: mjtObj
    def __int__(self) -> int: ...

class mjtDisableBit:
    mjDSBL_CONTACT: mjtDisableBit
    mjDSBL_CONSTRAINT: mjtDisableBit
    mjDSBL_GRAVITY: mjtDisableBit
    mjDSBL_EULERDAMP: mjtDisableBit
    def __int__(self) -> int: ...

class mjtEnableBit:
    mjENBL_SLEEP: mjtEnableBit
    def __int__(self) -> int: ...

class mjtJoint:
    mjJNT_FREE: mjtJoint
    mjJNT_HINGE: mjtJoint
    mjJNT_SLIDE: mjtJoint
    def __int__(self) -> int: ...

class mjtGeom:
    mjGEOM_SPHERE: mjtGeom
    mjGEOM_CAPSULE: mjtGeom
    mjGEOM_CYLINDER: mjtGeom
    mjGEOM_BOX: mjtGeom
    def __int__(self) -> int: ...

class mjtCatBit:
    mjCAT_DYNAMIC: mjtCatBit
    def __int__(self) -> int: ...

class mjtWarning:
    mjWARN_BADQACC: mjtWarning
    def __int__(self) -> int: ...

class MjModel:
    @staticmethod
    def from_xml_string(xml: str, assets: dict[str, bytes] | None = ...) -> MjModel: ...
    @staticmethod
    def from_xml_path(filename: str, assets: dict[str, bytes] | None = ...) -> MjModel: ...
    # sizes are int, everything else arrays and views by name
    nq: int
    nv: int
    nu: int
    na: int
    nbody: int
    njnt: int
    neq: int
    ngeom: int
    ntendon: int
    nsensordata: int
    names: bytes
    def __getattr__(self, name: str) -> Any: ...

class MjData:
    def __init__(self, model: MjModel) -> None: ...
    def __getattr__(self, name: str) -> Any: ...

class MjSpec:
    @staticmethod
    def from_string(
        xml: str, include: dict[str, bytes] | None = ..., assets: dict[str, bytes] | None = ...
    ) -> MjSpec: ...
    def __getattr__(self, name: str) -> Any: ...

class MjvCamera:
    def __getattr__(self, name: str) -> Any: ...

class MjvOption: ...
class MjvPerturb: ...

class Renderer:
    def __init__(self, model: MjModel, height: int = ..., width: int = ...) -> None: ...
    def __getattr__(self, name: str) -> Any: ...

def mj_forward(m: MjModel, d: MjData) -> None: ...
def mj_camlight(m: MjModel, d: MjData) -> None: ...
def mjv_addGeoms(m: MjModel, d: MjData, opt: MjvOption, pert: MjvPerturb, catmask: int, scn: Any) -> None: ...
def mj_kinematics(m: MjModel, d: MjData) -> None: ...
def mj_comPos(m: MjModel, d: MjData) -> None: ...
def mj_name2id(m: MjModel, type: mjtObj, name: str) -> int: ...
def mj_jacBodyCom(
    m: MjModel, d: MjData, jacp: NDArray[float64] | None, jacr: NDArray[float64] | None, body: int
) -> None: ...
def mj_mulM(m: MjModel, d: MjData, res: NDArray[float64], vec: NDArray[float64]) -> None: ...
def mj_jac(
    m: MjModel,
    d: MjData,
    jacp: NDArray[float64] | None,
    jacr: NDArray[float64] | None,
    point: NDArray[float64],
    body: int,
) -> None: ...
def mjd_transitionFD(
    m: MjModel,
    d: MjData,
    eps: float,
    flg_centered: bool,
    A: NDArray[float64] | None = ...,
    B: NDArray[float64] | None = ...,
    C: NDArray[float64] | None = ...,
    D: NDArray[float64] | None = ...,
) -> None: ...

class mjtState:
    mjSTATE_FULLPHYSICS: mjtState
    mjSTATE_QFRC_APPLIED: mjtState
    def __int__(self) -> int: ...

def mj_stateSize(m: MjModel, sig: int) -> int: ...
def mj_getState(m: MjModel, d: MjData, state: NDArray[float64], sig: int) -> None: ...
def mj_setConst(m: MjModel, d: MjData) -> None: ...
def mj_resetData(m: MjModel, d: MjData) -> None: ...
def mj_step(m: MjModel, d: MjData, nstep: int = ...) -> None: ...
def get_mju_user_warning() -> Any: ...
def set_mju_user_warning(user_warning: Any) -> None: ...

"""What beamchain uses of MuJoCo, which ships no types."""

from typing import Any

from numpy import float64, int32
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

class mjtEq:
    __members__: dict[str, mjtEq]
    def __int__(self) -> int: ...

class mjtConstraint:
    mjCNSTR_LIMIT_JOINT: mjtConstraint
    mjCNSTR_LIMIT_TENDON: mjtConstraint
    def __int__(self) -> int: ...

class mjtTrn:
    mjTRN_JOINT: mjtTrn
    mjTRN_JOINTINPARENT: mjtTrn
    mjTRN_SITE: mjtTrn
    def __int__(self) -> int: ...

class mjtWrap:
    mjWRAP_JOINT: mjtWrap
    def __int__(self) -> int: ...

class mjtObj:
    mjOBJ_BODY: mjtObj
    mjOBJ_CAMERA: mjtObj
    mjOBJ_GEOM: mjtObj
    mjOBJ_JOINT: mjtObj
    mjOBJ_XBODY: mjtObj
    mjOBJ_SITE: mjtObj
    mjOBJ_TENDON: mjtObj
    def __int__(self) -> int: ...

class mjtDisableBit:
    mjDSBL_CONTACT: mjtDisableBit
    mjDSBL_CLAMPCTRL: mjtDisableBit
    mjDSBL_CONSTRAINT: mjtDisableBit
    mjDSBL_GRAVITY: mjtDisableBit
    mjDSBL_EULERDAMP: mjtDisableBit
    mjDSBL_AUTORESET: mjtDisableBit
    def __int__(self) -> int: ...

class mjtEnableBit:
    mjENBL_SLEEP: mjtEnableBit
    def __int__(self) -> int: ...

class mjtJoint:
    mjJNT_FREE: mjtJoint
    mjJNT_BALL: mjtJoint
    mjJNT_HINGE: mjtJoint
    mjJNT_SLIDE: mjtJoint
    def __int__(self) -> int: ...

class mjtGeom:
    mjGEOM_SPHERE: mjtGeom
    mjGEOM_CAPSULE: mjtGeom
    mjGEOM_CYLINDER: mjtGeom
    mjGEOM_BOX: mjtGeom
    mjGEOM_PLANE: mjtGeom
    mjGEOM_ELLIPSOID: mjtGeom
    mjGEOM_MESH: mjtGeom
    def __int__(self) -> int: ...

class mjtTexture:
    mjTEXTURE_SKYBOX: mjtTexture

class mjtBuiltin:
    mjBUILTIN_FLAT: mjtBuiltin
    mjBUILTIN_GRADIENT: mjtBuiltin

class mjtMark:
    mjMARK_RANDOM: mjtMark

class mjtRndFlag:
    mjRND_SHADOW: mjtRndFlag
    def __int__(self) -> int: ...

class mjtLightType:
    mjLIGHT_DIRECTIONAL: mjtLightType

class mjtVisFlag:
    mjVIS_INERTIA: mjtVisFlag
    def __int__(self) -> int: ...

class mjtTextureRole:
    mjTEXROLE_RGB: mjtTextureRole
    def __int__(self) -> int: ...

class mjtCatBit:
    mjCAT_DYNAMIC: mjtCatBit
    mjCAT_DECOR: mjtCatBit
    def __int__(self) -> int: ...

class mjtWarning:
    mjWARN_BADQPOS: mjtWarning
    mjWARN_BADQVEL: mjtWarning
    mjWARN_BADQACC: mjtWarning
    def __int__(self) -> int: ...

class mjtBias:
    mjBIAS_NONE: mjtBias
    def __int__(self) -> int: ...

class mjtGain:
    mjGAIN_FIXED: mjtGain
    def __int__(self) -> int: ...

class mjtDyn:
    mjDYN_INTEGRATOR: mjtDyn
    def __int__(self) -> int: ...

class mjtSensor:
    def __int__(self) -> int: ...

class MjModel:
    @staticmethod
    def from_xml_string(xml: str, assets: dict[str, bytes] | None = ...) -> MjModel: ...
    @staticmethod
    def from_xml_path(filename: str, assets: dict[str, bytes] | None = ...) -> MjModel: ...
    @staticmethod
    def from_binary_path(filename: str) -> MjModel: ...
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
    def from_zip(file: Any, /) -> MjSpec: ...
    @staticmethod
    def from_string(
        xml: str, include: dict[str, bytes] | None = ..., assets: dict[str, bytes] | None = ...
    ) -> MjSpec: ...
    @staticmethod
    def from_file(filename: str) -> MjSpec: ...
    def __getattr__(self, name: str) -> Any: ...

class MjvCamera:
    def __getattr__(self, name: str) -> Any: ...

class MjvOption:
    def __getattr__(self, name: str) -> Any: ...

class MjvPerturb: ...

class MjvGeom:
    def __getattr__(self, name: str) -> Any: ...

class MjvScene:
    def __init__(self, model: MjModel, maxgeom: int) -> None: ...
    def __getattr__(self, name: str) -> Any: ...

class Renderer:
    def __init__(self, model: MjModel, height: int = ..., width: int = ...) -> None: ...
    def __getattr__(self, name: str) -> Any: ...

def mj_energyPos(m: MjModel, d: MjData) -> None: ...
def mj_energyVel(m: MjModel, d: MjData) -> None: ...
def mj_forward(m: MjModel, d: MjData) -> None: ...
def mj_fwdPosition(m: MjModel, d: MjData) -> None: ...
def mj_fwdVelocity(m: MjModel, d: MjData) -> None: ...
def mj_fwdActuation(m: MjModel, d: MjData) -> None: ...
def mj_sensorPos(m: MjModel, d: MjData) -> None: ...
def mj_sensorVel(m: MjModel, d: MjData) -> None: ...
def mj_sensorAcc(m: MjModel, d: MjData) -> None: ...
def mj_subtreeVel(m: MjModel, d: MjData) -> None: ...
def mj_differentiatePos(
    m: MjModel, qvel: NDArray[float64], dt: float, qpos1: NDArray[float64], qpos2: NDArray[float64]
) -> None: ...
def mju_subQuat(res: NDArray[float64], qa: NDArray[float64], qb: NDArray[float64]) -> None: ...
def mj_applyFT(
    m: MjModel,
    d: MjData,
    force: NDArray[float64],
    torque: NDArray[float64],
    point: NDArray[float64],
    body: int,
    qfrc_target: NDArray[float64],
) -> None: ...
def mj_camlight(m: MjModel, d: MjData) -> None: ...
def mjv_addGeoms(
    m: MjModel, d: MjData, opt: MjvOption, pert: MjvPerturb, catmask: int, scn: Any
) -> None: ...
def mjv_updateScene(
    m: MjModel,
    d: MjData,
    opt: MjvOption,
    pert: MjvPerturb | None,
    cam: MjvCamera,
    catmask: int,
    scn: MjvScene,
) -> None: ...
def mjv_initGeom(
    geom: Any,
    type: mjtGeom,
    size: NDArray[float64],
    pos: NDArray[float64],
    mat: NDArray[float64],
    rgba: Any,
) -> None: ...
def mj_inverse(m: MjModel, d: MjData) -> None: ...
def mj_kinematics(m: MjModel, d: MjData) -> None: ...
def mj_comPos(m: MjModel, d: MjData) -> None: ...
def mj_name2id(m: MjModel, type: mjtObj, name: str) -> int: ...
def mj_jacBodyCom(
    m: MjModel, d: MjData, jacp: NDArray[float64] | None, jacr: NDArray[float64] | None, body: int
) -> None: ...
def mj_integratePos(
    m: MjModel, qpos: NDArray[float64], qvel: NDArray[float64], dt: float
) -> None: ...
def mju_sparse2dense(
    res: NDArray[float64],
    mat: NDArray[float64],
    rownnz: NDArray[int32],
    rowadr: NDArray[int32],
    colind: NDArray[int32],
) -> None: ...
def mju_mat2Quat(quat: NDArray[float64], mat: NDArray[float64]) -> None: ...
def mju_quat2Mat(res: NDArray[float64], quat: NDArray[float64]) -> None: ...
def mju_mulQuat(
    res: NDArray[float64], quat1: NDArray[float64], quat2: NDArray[float64]
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
    mjSTATE_INTEGRATION: mjtState
    mjSTATE_CTRL: mjtState
    mjSTATE_FULLPHYSICS: mjtState
    mjSTATE_QFRC_APPLIED: mjtState
    mjSTATE_TIME: mjtState
    def __int__(self) -> int: ...

def mj_stateSize(m: MjModel, sig: int) -> int: ...
def mj_getState(m: MjModel, d: MjData, state: NDArray[float64], sig: int) -> None: ...
def mj_setState(m: MjModel, d: MjData, state: NDArray[float64], sig: int) -> None: ...
def mj_copyData(dest: MjData, m: MjModel, src: MjData) -> None: ...
def mj_setConst(m: MjModel, d: MjData) -> None: ...
def mj_resetData(m: MjModel, d: MjData) -> None: ...
def mj_resetDataKeyframe(m: MjModel, d: MjData, key: int) -> None: ...
def mj_rnePostConstraint(m: MjModel, d: MjData) -> None: ...
def mj_objectVelocity(
    m: MjModel, d: MjData, objtype: mjtObj, objid: int, res: Any, flg_local: int
) -> None: ...
def mj_objectAcceleration(
    m: MjModel, d: MjData, objtype: mjtObj, objid: int, res: Any, flg_local: int
) -> None: ...
def mj_step(m: MjModel, d: MjData, nstep: int = ...) -> None: ...
def get_mju_user_warning() -> Any: ...
def set_mju_user_warning(user_warning: Any) -> None: ...

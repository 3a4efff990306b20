from . import page as page
from .request import identify as identify
from .result import Identification as Identification
from .sysid import to_sysid as to_sysid

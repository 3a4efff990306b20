from .worlds import Worlds as Worlds
from .worlds import make as make

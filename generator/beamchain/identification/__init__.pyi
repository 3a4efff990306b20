from . import page as page
from .request import identify as identify
from .result import Identification as Identification

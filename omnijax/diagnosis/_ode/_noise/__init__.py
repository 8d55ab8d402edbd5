"""What rows weigh: the noise of sensors, its colour in a balance, and what no law explains."""

from .colour import AbstractColoured as AbstractColoured
from .colour import Colour as Colour
from .colour import in_colour as in_colour
from .floor import beside as beside
from .floor import best_known as best_known
from .floor import settled as settled
from .floor import turned as turned
from .row_noise import RowNoise as RowNoise
from .sensor_noise import sensor_noise as sensor_noise

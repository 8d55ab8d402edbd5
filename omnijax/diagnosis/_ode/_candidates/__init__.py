"""What a machine may lack: laws at their places, their orders, ranges and signatures."""

from .candidates import Scales as Scales
from .candidates import machine_candidates as machine_candidates
from .orders import strongest_orders as strongest_orders
from .ranges import ranges_of as ranges_of
from .signatures import signatures as signatures
from .together import lines_together as lines_together

"""The data vector: residuals whitened by the noise of their channels."""

from .data_vector import ELASTIC_CHANNELS as ELASTIC_CHANNELS
from .data_vector import DataRows as DataRows
from .data_vector import rotation_channels as rotation_channels
from .encoders import PARTS as PARTS
from .encoders import response_rows as response_rows
from .noise_model import rolling_state as rolling_state
from .noise_model import rows_of as rows_of
from .turning_noise import RunWaves as RunWaves
from .turning_noise import TurningNoise as TurningNoise

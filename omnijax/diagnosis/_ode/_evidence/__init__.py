"""What stands behind a machine's answer: evidence, the learned term, the next experiment."""

from .evidence import OdeEvidence as OdeEvidence
from .evidence import balance_error as balance_error
from .evidence import missed_output as missed_output

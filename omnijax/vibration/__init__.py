"""What a run's vibration amounts to: metrics with units and exact gradients."""

from typing import TYPE_CHECKING

from .._lazy import lazy_face

if TYPE_CHECKING:
    from ._amplitude import follows as follows
    from ._amplitude import norm as norm
    from ._amplitude import peak as peak
    from ._amplitude import peak_to_peak as peak_to_peak
    from ._amplitude import rms as rms
    from ._amplitude import smooth_peak as smooth_peak
    from ._comfort import weighted_acceleration as weighted_acceleration
    from ._comfort import weighting as weighting
    from ._in_bulk import BULK_STEADY_METRICS as BULK_STEADY_METRICS
    from ._in_bulk import long_run_metrics as long_run_metrics
    from ._in_bulk import run_metrics as run_metrics
    from ._metrics import METRICS as METRICS
    from ._metrics import STEADY_METRICS as STEADY_METRICS
    from ._metrics import Metric as Metric
    from ._metrics import evaluate as evaluate
    from ._metrics import known as known
    from ._metrics import metric_problem as metric_problem
    from ._metrics import steady_metric as steady_metric
    from ._metrics import steady_metrics as steady_metrics
    from ._modes import Modes as Modes
    from ._modes import modes as modes
    from ._modes import natural_frequencies as natural_frequencies
    from ._order_results import OrderMap as OrderMap
    from ._order_results import OrderTrack as OrderTrack
    from ._orders import order_track as order_track
    from ._orders import roller_orders as roller_orders
    from ._orders import rpm_order_map as rpm_order_map
    from ._steady import ContactLoad as ContactLoad
    from ._steady import SteadyRun as SteadyRun
    from ._steady import contact_load as contact_load
    from ._waterfall import name_of as name_of

__getattr__, __dir__ = lazy_face(__name__)

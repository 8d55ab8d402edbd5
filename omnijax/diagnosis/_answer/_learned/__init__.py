"""Learned terms: smooth functions at the ports of a machine that may close what no law does."""

from .learned import learn as learn
from .misshapen import misshapen as misshapen
from .near_laws import NearLaw as NearLaw
from .near_laws import near_laws as near_laws

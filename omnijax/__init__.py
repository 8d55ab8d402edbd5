"""omnijax: differentiable simulation, design and diagnosis of a sphere on omnidirectional wheels."""

__version__ = "0.1.0"

"""How often is a hidden effect found, and what is named where nothing, or nothing known, is hidden?

Every seed draws a machine, its runs, the noise and its declaration, and what is hidden in it.  The
data come from `benchmarks/plant.py`, which shares nothing with the package.
"""

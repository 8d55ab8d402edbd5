"""Does anything hold each sign, factor, exponent and port?  `python -m tests.mutants [WORD ...]`

Every equation of laws, kinematics, rotation, translation, sensors and drives is changed once at a
time, in memory: a sign turned, a product divided, a power raised, a constant doubled, a function
or an input exchanged for its neighbour, a law moved to another port.  A change is killed when a
formula's numbers no longer come out.  `changes` says what may go wrong in an expression, `living`
puts changed code under a function that is in use, `equations` lists what is changed, `killing`
finds the numbers that hold a function and tries them.
"""

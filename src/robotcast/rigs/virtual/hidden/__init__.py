"""Hidden effects of the virtual rig: the truth that a diagnosis is asked to find.

They act through MuJoCo itself (gravity, medium, contacts, springs, masses) or through forces
written here, on the three-dimensional cable. They share no code with robotcast.effects, whose
classes act on the simulators that diagnose. `library` holds mechanisms that a diagnosis can
name, with sizes in its units; `outside` holds mechanisms it has no name for.
"""

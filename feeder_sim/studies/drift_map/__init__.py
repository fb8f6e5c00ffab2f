"""A part as a point that drifts and diffuses: tabulated on standing waves, used on any plate and mode.

On a surface of local amplitude a and slope s, driven at the circular frequency omega, a part moves by

    dx = v dt + sqrt(2 D dt) noise,    v toward falling amplitude

where v and D are functions of the frequency, of a and of s alone. Those of a strip of the same thickness are measured
once for a part and a contact law. Much of what is in them is known: v goes with the speed omega s h/2 at which the top
surface moves to and fro, D with the cube of the speed omega a over gravity. What is left is tabulated without units.

Rooms: `making` (runs on strips, from paths to a table), `drift_map` (the table and its look-up),
`walk` (parts on the plate of a scenario), `files`.
"""

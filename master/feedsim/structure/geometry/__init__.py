"""A machine written as geometry: beams, masses, guides and drives, assembled at any pose of its axes.

May use the scenario's models of a structure, and assembly. Sole place of finite elements of our own.
Start with assemble.py; mesh.py has nodes and beams, springs.py what joins the bodies.
"""

"""Friction compensation: circle without and with it, torque feedforward, what errors cost."""

"""The rigid body: geometry, kinematics, inverse dynamics, base parameters."""

"""Effects in the joint: rotor, friction, transmission."""

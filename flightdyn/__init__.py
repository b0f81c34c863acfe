"""Flight dynamics: write the equations of motion once, then plan, simulate, replay and verify."""

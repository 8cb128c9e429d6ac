"""A plant, a controller, an integrator and a duration → a trajectory that says how far it can be trusted."""

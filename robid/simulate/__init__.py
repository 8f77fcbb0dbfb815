"""The simulated experiment: controller, imperfections, closed loop."""

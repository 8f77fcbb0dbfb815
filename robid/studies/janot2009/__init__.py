"""The study of robust regression. Read `haptic`, the one-axis device, then `tx40`, the measured arm."""

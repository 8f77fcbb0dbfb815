"""The page. Read `section`, `charts`, `page`; `parameters`, `parameter_section`, `costs`, `experiment`, `design`."""

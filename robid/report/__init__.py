"""The page. Read `section`, `content`, `page`, then `parameters`, `costs`, `experiment`, `design`."""

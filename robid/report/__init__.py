"""The page. Read `section`, `content`, `page`, then what lays out rows: `parameters`, `costs`, `experiment`, `design`."""

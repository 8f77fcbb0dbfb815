"""What reproduces a paper or a comparison beyond its file. Read `study`, `tasks`, then a package for each study."""

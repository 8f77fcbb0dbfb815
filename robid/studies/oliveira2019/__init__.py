"""External dynamics, as of Oliveira et al. (2019). Read `bench`, `judging`, the parts `plants`, `seeds`, `arm`."""

"""The model at rest: errors against deviations, blocks, responses over the positions. Read `figures`, then `page`."""

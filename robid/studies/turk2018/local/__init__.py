"""The model at rest beside the paper's. Read `figures`, `tables`, `pictures`, then `page`."""

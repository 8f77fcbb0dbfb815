"""The paper's transfer functions as plants. Read `bench`, `identification`, `runs`, `coverage`, then `page`."""

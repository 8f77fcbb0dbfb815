"""What must hold beyond the types of the fields, one module a section. Read `experiment` and `robot` first."""

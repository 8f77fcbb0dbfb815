"""What a rigid model is worth. Read `prediction`, then `validating` and `grading`."""

"""How golden cases are made: one module a family, which holds its cases and its wrong ports side by side."""

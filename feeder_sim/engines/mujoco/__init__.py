"""MuJoCo's own time stepping over tangent patches that follow the moving surface."""

"""Ways of advancing a scene: impulses, a slide of one degree of freedom, MuJoCo. None knows another."""

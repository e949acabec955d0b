"""The grains of scenes of the laboratory unless a study gives others."""

from fidelity.grains.settings import MaterialSettings

# Glass beads, softened for longer time steps.
BEADS = MaterialSettings(
    young_modulus_pa=5e6, poisson_ratio=0.25, density_kg_m3=2500, friction_angle_deg=20
)

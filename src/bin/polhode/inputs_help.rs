//! Distributions, sweeps and units, as `polhode run --help` describes them.

/// The forms that numbers of a study may take.
pub const INPUTS_HELP: &str = "\
Any number or vector of a body, and any parameter of a torque or force that bodies need not share,
may be a distribution, and a parameter a column of the table of bodies: { column = \"drag\" },
{ columns = [\"tx\", \"ty\", \"tz\"] }. Every draw depends on seed, body and column alone.
    constant (value), uniform (low, high), normal (mean, sigma), log-normal (median, sigma of the
    logarithm), truncated-normal (mean, sigma, low, high), exponential (mean), rayleigh (sigma),
    triangular (low, mode, high)
                          numbers, and vectors component by component: one number stands for three
    mixture               weights = [3, 1], of = [a number or distribution for each weight]
    rows                  file = \"catalogue.csv\", column or columns: a row of it, the same for all
                          keys that name the file
    correlated            variable = \"craft.size\", of a group of normal variables:
                          [correlated.craft] variables = [\"size\", \"spin\"], mean = [...], and
                          covariance = [[...], ...], or sigma = [...] and correlation = [[...], ...]
    of vectors            [x, y, z] of numbers and distributions; normal (mean, covariance: three
                          rows); with a magnitude, itself a number or distribution: direction,
                          uniform on the sphere; von-mises-fisher (axis, concentration); cone
                          (axis, half_angle, rad)
    of orientations       uniform on SO(3); scatter (about, sigma, rad: normal rotation vector in
                          body axes); { axis, angle = distribution }; { euler = \"zyx\", angles =
                          three numbers or distributions [about: body, the default, or world] }
    of angular velocities by the body's own moments: thermal (temperature, K), fixed-energy
                          (energy, J), fixed-angular-momentum (angular_momentum, kg m²/s)

Sweeps: { sweep = \"drag\" } in place of a number, also in a distribution, takes an axis' values.
    [[sweep]]             name, and values = [...], or from, to, count [scale: linear, logarithmic]
    [design]              kind: grid (all combinations, the last axis changing fastest; the
                          default), latin-hypercube, sobol (Owen-scrambled), with points = N and
                          without count; common_draws = true: the n-th bodies of all cells have the
                          same draws
    bodies.count          of each cell; body b lies in cell b modulo the number of cells

Units, with powers and quotients: \"kg m^2\", \"m³/s²\", \"N m/(rad/s)\", \"deg/√h\". Angles are not plain
numbers: an angular velocity is in rad/s, deg/s or rpm, not in Hz. Prefixes are those of the SI:";

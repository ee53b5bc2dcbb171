// The midpoint equation of the free body. Twin: src/kernel/method/midpoint.rs, which describes it.

// Three columns of a 3 x 3 matrix.
struct Matrix {
    x: vector,
    y: vector,
    z: vector,
}

// The solution of A x = b by Cramer's rule; A must not be singular.
fn solve(a: Matrix, b: vector) -> vector {
    let yz = cross_vector(a.y, a.z);
    let inverse_determinant = 1.0 / dot_vector(a.x, yz);
    let bz = cross_vector(b, a.z);
    let yb = cross_vector(a.y, b);
    return vector(dot_vector(b, yz), dot_vector(a.x, bz), dot_vector(a.x, yb)) * inverse_determinant;
}

// The largest magnitude of a component.
fn largest(v: vector) -> real {
    return max(max(abs(v.x), abs(v.y)), abs(v.z));
}

// 1 - factor dG/dz.
fn jacobian(body: Body, factor: real, z: vector) -> Matrix {
    let g = body.gyroscopic.value * (-factor);
    return Matrix(
        vector(1.0, g.y * z.z, g.z * z.y),
        vector(g.x * z.z, 1.0, g.z * z.x),
        vector(g.x * z.y, g.y * z.x, 1.0),
    );
}

// The relative size of a correction that Newton's method may omit.
fn newton_tolerance() -> real {
    return select(real(1.0 / 4096.0), real(1.0 / 134217728.0), WORDS == 1u);
}

// A length that is nonzero even for a body at rest.
fn scale_of(m: vector) -> real {
    return max(largest(m), 1e-30);
}

struct Discrete {
    // G(z).
    gyroscopic_term: vector,
    // z / I.
    angular_velocity: vector,
    // alpha - 1.
    excess: real,
    // Newton's method did not converge.
    unsolved: bool,
    // |h omega| is greater than 1 and no alpha exists.
    beyond: bool,
}

const DISCRETE_ITERATIONS: u32 = 12u;

// Solves z = m + alpha h G(z)/2, alpha = 1 + |alpha h omega / 2|^2 by Newton's method.
fn solve_discrete(body: Body, correction: Correction, h: real, m: vector) -> Discrete {
    let half = h * 0.5;
    let least: real = 1.0 / 4096.0;
    let tolerance = newton_tolerance() * scale_of(m);

    var z = axpy_vector(gyroscopic_term(body, m, correction), half, m);
    z = axpy_vector(gyroscopic_term(body, z, correction), half, m);
    var unsolved = true;
    for (var n = 0u; n < DISCRETE_ITERATIONS; n += 1u) {
        let omega = angular_velocity(body, z, correction);
        let g = gyroscopic_term(body, z, correction);
        let kappa = half * half * dot_vector(omega, omega);
        let root = sqrt(max(1.0 - 4.0 * kappa, least));
        let alpha = 2.0 / (1.0 + root);
        let factor = alpha * half;
        let residual = axpy_vector(g, factor, m - z);
        let slope = (body.inverse_moments.value * omega) * (2.0 * half * half * half * alpha * alpha / root);
        var a = jacobian(body, factor, z);
        a.x = a.x - g * slope.x;
        a.y = a.y - g * slope.y;
        a.z = a.z - g * slope.z;
        let change = solve(a, residual);
        z = z + change;
        unsolved = !(largest(change) < tolerance);
        if (!unsolved) {
            break;
        }
    }
    let omega = angular_velocity(body, z, correction);
    let kappa = half * half * dot_vector(omega, omega);
    let root = sqrt(max(1.0 - 4.0 * kappa, least));
    let sum = 1.0 + root;
    return Discrete(
        gyroscopic_term(body, z, correction),
        omega,
        4.0 * kappa / (sum * sum),
        unsolved,
        1.0 < 4.0 * kappa,
    );
}

// The increment of q by a Cayley rotation: its vector part is h omega (1 + vector_excess)/2, its scalar part 1 + scalar_excess.
fn cayley_increment(
    q: quaternion, angular_velocity: vector, h: TwoWordsReal, vector_excess: real, scalar_excess: real
) -> quaternion {
    let half = h.value * 0.5;
    let rest = mul_add(vector_excess, half, h.residue * 0.5);
    let v = axpy_vector(angular_velocity, half, rounded_vector(angular_velocity * rest));
    return product_vector(q, v) + q * scalar_excess;
}

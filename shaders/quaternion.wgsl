// Unit quaternions that rotate body (or principal) coordinates to world. Twin: src/math/quaternion.rs.

fn dot_vector(a: vector, b: vector) -> real {
    return mul_add(a.z, b.z, mul_add(a.y, b.y, a.x * b.x));
}

fn cross_vector(a: vector, b: vector) -> vector {
    return vector(
        mul_add(a.y, b.z, -(a.z * b.y)),
        mul_add(a.z, b.x, -(a.x * b.z)),
        mul_add(a.x, b.y, -(a.y * b.x)),
    );
}

fn norm_squared(q: quaternion) -> real {
    return mul_add(q.w, q.w, mul_add(q.z, q.z, mul_add(q.y, q.y, q.x * q.x)));
}

// Hamilton's product: the rotation b, then the rotation a.
fn product(a: quaternion, b: quaternion) -> quaternion {
    return quaternion(
        mul_add(a.w, b.x, mul_add(a.x, b.w, mul_add(a.y, b.z, -(a.z * b.y)))),
        mul_add(a.w, b.y, mul_add(a.y, b.w, mul_add(a.z, b.x, -(a.x * b.z)))),
        mul_add(a.w, b.z, mul_add(a.z, b.w, mul_add(a.x, b.y, -(a.y * b.x)))),
        mul_add(a.w, b.w, -(mul_add(a.x, b.x, mul_add(a.y, b.y, a.z * b.z)))),
    );
}

// Hamilton's product q (v, 0) by a pure vector.
fn product_vector(q: quaternion, v: vector) -> quaternion {
    return quaternion(
        mul_add(q.w, v.x, mul_add(q.y, v.z, -(q.z * v.y))),
        mul_add(q.w, v.y, mul_add(q.z, v.x, -(q.x * v.z))),
        mul_add(q.w, v.z, mul_add(q.x, v.y, -(q.y * v.x))),
        -(mul_add(q.x, v.x, mul_add(q.y, v.y, q.z * v.z))),
    );
}

fn conjugate(q: quaternion) -> quaternion {
    return quaternion(-q.x, -q.y, -q.z, q.w);
}

// Body (or principal) coordinates to world: v + 2w (u x v) + 2 u x (u x v), u the vector part.
fn rotate(q: quaternion, v: vector) -> vector {
    let twice_cross = cross_vector(q.xyz, v) * 2.0;
    return v + twice_cross * q.w + cross_vector(q.xyz, twice_cross);
}

// World coordinates to body (or principal).
fn rotate_inverse(q: quaternion, v: vector) -> vector {
    return rotate(conjugate(q), v);
}

// q * factor + addend, component by component.
fn axpy_quaternion(q: quaternion, factor: real, addend: quaternion) -> quaternion {
    return fma(q, quaternion(factor, factor, factor, factor), addend);
}

fn axpy_vector(v: vector, factor: real, addend: vector) -> vector {
    return fma(v, vector(factor, factor, factor), addend);
}

// The increment that brings a quaternion near the unit sphere back onto it: (1 - |q|^2)/2 q.
fn norm_correction(q: quaternion) -> quaternion {
    return norm_correction_of_step(q, q);
}

// The correction of a step from q to next: (1 - |q|^2)/2 next.
fn norm_correction_of_step(q: quaternion, next: quaternion) -> quaternion {
    return next * (0.5 * (1.0 - norm_squared(q)));
}

// The quaternion of a rotation vector less 1: (sin t/2 axis, cos t/2 - 1), t its length.
fn exponential_less_one(rotation_vector: vector) -> quaternion {
    let angle = sqrt(max(dot_vector(rotation_vector, rotation_vector), 1e-36));
    let quarter = sin_cos(angle * 0.25);
    let v = rotation_vector * (2.0 * quarter.sin * quarter.cos / angle);
    return quaternion(v.x, v.y, v.z, -2.0 * quarter.sin * quarter.sin);
}

// A vector in one word, as in programs that do not compensate.
fn plain_vector(value: vector) -> TwoWordsVector {
    return TwoWordsVector(value, vector(0.0, 0.0, 0.0));
}

// q/|q| in one word, as in programs that do not compensate.
fn plainly_normalised(q: quaternion) -> TwoWordsQuaternion {
    return TwoWordsQuaternion(q * (1.0 / sqrt(norm_squared(q))), quaternion(0.0, 0.0, 0.0, 0.0));
}

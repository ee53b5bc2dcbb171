// The compositions of splitting4, by the ends of their substeps as fractions of the step. Twin: the constants of
// src/kernel/method/splitting.rs.

const ORDER: u32 = 4u;

// SRKN6B, for a torque that does not depend on the angular velocity.
var<private> srkn6b_kick_ends: array<real, 7> = array<real, 7>(
    0.0829844064174052,
    0.4792942079157732,
    0.4402379029934246,
    0.5597620970065754,
    0.5207057920842268,
    0.9170155935825948,
    1.0,
);
var<private> srkn6b_drift_ends: array<real, 6> = array<real, 6>(
    0.245298957184271,
    0.850171622895351,
    0.5,
    0.149828377104649,
    0.754701042815729,
    1.0,
);

// BM4, for any torque.
var<private> bm4_kick_ends: array<real, 7> = array<real, 7>(
    0.0792036964311957,
    0.4323766024809697,
    0.3903115221232502,
    0.6096884778767498,
    0.5676233975190303,
    0.9207963035688043,
    1.0,
);
var<private> bm4_drift_ends: array<real, 6> = array<real, 6>(
    0.209515106613362,
    0.065663333433544,
    0.5,
    0.934336666566456,
    0.790484893386638,
    1.0,
);

fn kick_count() -> u32 {
    return select(7u, 7u, velocity_dependence() == NO_DEPENDENCE);
}

fn drift_count() -> u32 {
    return kick_count() - 1u;
}

fn kick_end(i: u32) -> real {
    if (velocity_dependence() == NO_DEPENDENCE) {
        return srkn6b_kick_ends[i];
    }
    return bm4_kick_ends[i];
}

fn drift_end(i: u32) -> real {
    if (velocity_dependence() == NO_DEPENDENCE) {
        return srkn6b_drift_ends[i];
    }
    return bm4_drift_ends[i];
}

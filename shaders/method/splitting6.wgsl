// The compositions of splitting6, by the ends of their substeps as fractions of the step. Twin: the constants of
// src/kernel/method/splitting.rs.

const ORDER: u32 = 6u;

// SRKN11B, for a torque that does not depend on the angular velocity.
var<private> srkn11b_kick_ends: array<real, 12> = array<real, 12>(
    0.0414649985182624,
    0.2395936704363294,
    0.1995874783321761,
    0.2748414626337568,
    0.2633300752130689,
    0.5,
    0.7366699247869311,
    0.7251585373662432,
    0.8004125216678239,
    0.7604063295636706,
    0.9585350014817376,
    1.0,
);
var<private> srkn11b_drift_ends: array<real, 11> = array<real, 11>(
    0.123229775946271,
    0.413783573745829,
    0.286734361120412,
    0.040402600058337,
    0.397611472854265,
    0.602388527145735,
    0.959597399941663,
    0.713265638879588,
    0.586216426254171,
    0.876770224053729,
    1.0,
);

// BM6, for any torque.
var<private> bm6_kick_ends: array<real, 11> = array<real, 11>(
    0.0502627644003922,
    0.4637770648287362,
    0.5088569546231339,
    0.3208021008035649,
    0.8627627792543449,
    0.1372372207456551,
    0.6791978991964351,
    0.4911430453768661,
    0.5362229351712638,
    0.9497372355996078,
    1.0,
);
var<private> bm6_drift_ends: array<real, 10> = array<real, 10>(
    0.148816447901042,
    0.016430582133258,
    0.083738186825443,
    0.516404589403618,
    0.5,
    0.483595410596382,
    0.916261813174557,
    0.983569417866742,
    0.851183552098958,
    1.0,
);

fn kick_count() -> u32 {
    return select(11u, 12u, velocity_dependence() == NO_DEPENDENCE);
}

fn drift_count() -> u32 {
    return kick_count() - 1u;
}

fn kick_end(i: u32) -> real {
    if (velocity_dependence() == NO_DEPENDENCE) {
        return srkn11b_kick_ends[i];
    }
    return bm6_kick_ends[i];
}

fn drift_end(i: u32) -> real {
    if (velocity_dependence() == NO_DEPENDENCE) {
        return srkn11b_drift_ends[i];
    }
    return bm6_drift_ends[i];
}

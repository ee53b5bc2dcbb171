// Strang's composition, by the ends of its substeps as fractions of the step. Twin: STRANG in src/kernel/method/splitting.rs.

const ORDER: u32 = 2u;

fn kick_count() -> u32 {
    return 2u;
}

fn drift_count() -> u32 {
    return 1u;
}

fn kick_end(i: u32) -> real {
    return select(real(1.0), real(0.5), i == 0u);
}

fn drift_end(i: u32) -> real {
    return 1.0;
}

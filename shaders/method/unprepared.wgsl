// For methods that form nothing once a body. Twin: Step::Prepared = () in src/kernel/method/.

struct Prepared {
    unused: u32,
}

fn prepare(body: Body, invariants: Invariants, dt: TwoWordsReal) -> Prepared {
    return Prepared(0u);
}

// For methods that prepare nothing for a body. Twin: Step::Prepared = () in src/kernel/method/.

struct Prepared {
    unused: u32,
}

fn prepare(body: Body, invariants: Invariants, dt: TwoWordsReal) -> Prepared {
    return Prepared(0u);
}

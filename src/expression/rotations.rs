//! Finds vectors that a quaternion rotates in a graph.
//!
//! [`Quaternion::rotate`](crate::math::quaternion::Quaternion::rotate) is some forty operations, which a formula may contain many times; as
//! one instruction it reads seven numbers and stores three. With u the vector part (negated for the inverse rotation), t = 2 u × v and (c,
//! a, b) in cyclic order a component is
//!
//! ```text
//! v_c + t_c w + (u_a t_b − u_b t_a)
//! ```

use super::graph::{Binary, Graph, Node, Operation, Unary};

/// A rotated vector.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rotation {
    /// The components of the result, in cyclic order.
    pub results: [Node; 3],
    /// In the same order, x, y, z and w of the quaternion and the components of the vector.
    pub operands: [Node; 7],
    /// Whether the conjugate rotates.
    pub is_inverse: bool,
}

/// A component of what may be a rotated vector.
#[derive(Clone, Copy, Debug)]
struct Component {
    result: Node,
    /// t_c, t_a, t_b.
    doubles: [Node; 3],
    /// The quaternion's components a and b, and w.
    q: [Node; 3],
    /// v_c.
    v: Node,
    is_inverse: bool,
}

/// The rotated vectors of a graph whose components are all among `live`.
pub(super) fn rotations(graph: &Graph, live: &[Node]) -> Vec<Rotation> {
    let components: Vec<Component> = live.iter().filter_map(|&node| component(graph, node)).collect();
    let mut found: Vec<Rotation> = Vec::new();
    for &first in &components {
        let [c, a, b] = first.doubles;
        let is_known = found.iter().any(|rotation| rotation.results.contains(&first.result));
        let with = |doubles| components.iter().find(|other| other.doubles == doubles && is_alike(other, &first));
        let (Some(second), Some(third)) = (with([a, b, c]), with([b, c, a])) else { continue };
        let [q_a, q_b, w] = first.q;
        let q_c = second.q[1];
        let fits = second.q[0] == q_b && third.q[..2] == [q_c, q_a];
        let (q, v) = ([q_c, q_a, q_b], [first.v, second.v, third.v]);
        let is_turned = [0, 1, 2].into_iter().all(|axis| {
            let (next, after) = ((axis + 1) % 3, (axis + 2) % 3);
            let cross = cross_factors(graph, first.doubles[axis], first.is_inverse);
            cross.is_some_and(|[p, r]| {
                let is = |[x, y]: [Node; 2], z, w| [x, y] == [z, w] || [x, y] == [w, z];
                is(p, q[next], v[after]) && is(r, q[after], v[next])
            })
        });
        if !is_known && fits && is_turned {
            found.push(Rotation {
                results: [first.result, second.result, third.result],
                operands: [q_c, q_a, q_b, w, v[0], v[1], v[2]],
                is_inverse: first.is_inverse,
            });
        }
    }
    found
}

fn is_alike(a: &Component, b: &Component) -> bool {
    a.is_inverse == b.is_inverse && a.q[2] == b.q[2]
}

/// The parts of the component, if it has this form.
fn component(graph: &Graph, result: Node) -> Option<Component> {
    let of_orders = |(sum, last): (Node, Node)| {
        let ([q_a, t_b], [q_b, t_a], is_inverse) = difference(graph, last)?;
        // The factor itself shows which one is the double.
        let ordered = |[x, y]: [Node; 2]| match (is_double(graph, x), is_double(graph, y)) {
            (false, true) => Some([x, y]),
            (true, false) => Some([y, x]),
            _ => None,
        };
        let ([q_a, t_b], [q_b, t_a]) = (ordered([q_a, t_b])?, ordered([q_b, t_a])?);
        let (v, [w, t_c]) = both_orders(graph.operation(sum), Binary::Add)?
            .into_iter()
            .find_map(|(v, product)| Some((v, factors(graph, product).and_then(ordered)?)))?;
        Some(Component { result, doubles: [t_c, t_a, t_b], q: [q_a, q_b, w], v, is_inverse })
    };
    both_orders(graph.operation(result), Binary::Add)?.into_iter().find_map(of_orders)
}

/// The operands of a sum or a product, in both orders.
fn both_orders(operation: Operation, kind: Binary) -> Option<[(Node, Node); 2]> {
    match operation {
        Operation::Binary(found, a, b) if found == kind => Some([(a, b), (b, a)]),
        _ => None,
    }
}

fn factors(graph: &Graph, node: Node) -> Option<[Node; 2]> {
    both_orders(graph.operation(node), Binary::Mul).map(|[(a, b), _]| [a, b])
}

/// x, if the node is 2 x.
fn half(graph: &Graph, node: Node) -> Option<Node> {
    let orders = both_orders(graph.operation(node), Binary::Mul)?;
    orders.into_iter().find_map(|(a, b)| (graph.constant(a) == Some(2.0)).then_some(b))
}

fn is_double(graph: &Graph, node: Node) -> bool {
    half(graph, node).is_some_and(|half| matches!(graph.operation(half), Operation::MulAdd(..)))
}

/// The factors of both products of u_a x − u_b y, without the signs of u, and whether those are negative: it is then
/// −q_a x + q_b y, as a graph places signs.
fn difference(graph: &Graph, node: Node) -> Option<([Node; 2], [Node; 2], bool)> {
    let Operation::MulAdd(a, b, c) = graph.operation(node) else { return None };
    let negated = |node: Node| match graph.operation(node) {
        Operation::Unary(Unary::Neg, x) => Some(x),
        _ => None,
    };
    match (negated(a), negated(b), negated(c)) {
        (Some(a), None, None) => Some(([a, b], factors(graph, c)?, true)),
        (None, Some(b), None) => Some(([a, b], factors(graph, c)?, true)),
        (None, None, Some(c)) => Some(([a, b], factors(graph, c)?, false)),
        _ => None,
    }
}

/// The factors of both products of the half of t, if the signs are as required.
fn cross_factors(graph: &Graph, double: Node, is_inverse: bool) -> Option<[[Node; 2]; 2]> {
    let (first, second, negative) = difference(graph, half(graph, double)?)?;
    (negative == is_inverse).then_some([first, second])
}

#[cfg(test)]
mod tests {
    use super::super::program::Kind;
    use super::super::symbols::{Shape, Symbols};
    use super::super::{Expression, Program};
    use crate::math::quaternion::Quaternion;
    use crate::math::vector::Vector;

    fn program(text: &str) -> Program {
        let symbols = Symbols::rotation().parameter("v", Shape::Vector).unwrap().parameter("q", Shape::Quaternion);
        Expression::parse(text, &symbols.unwrap(), Shape::Vector)
            .unwrap_or_else(|error| panic!("{text}: {error}"))
            .program()
    }

    /// How many instructions rotate a vector, and how many there are in all.
    fn counted(text: &str) -> (usize, usize) {
        let program = program(text);
        let turns = program.instructions.iter().filter(|instruction| matches!(instruction.kind, Kind::Rotate(_)));
        (turns.count(), program.instructions.len())
    }

    #[test]
    fn a_turned_vector_is_one_instruction() {
        assert_eq!(counted("to_body(v)"), (1, 1));
        assert_eq!(counted("to_world(v)"), (1, 1));
        assert_eq!(counted("to_world(to_body(v))"), (2, 2));
        assert_eq!(counted("to_body(v) + to_world(v)"), (2, 5));
        // The components of a product of quaternions rotate it as well.
        assert_eq!(counted("let p = attitude * q;\nlet u = vec(p.x, p.y, p.z);\nlet t = 2 * cross(u, v);\nv + p.w * t + cross(u, t)").0, 1);
    }

    #[test]
    fn what_only_looks_like_a_turned_vector_is_none() {
        let turned = |text: &str| counted(&format!("let q_v = vec(q.x, q.y, q.z);\n{text}")).0;
        assert_eq!(turned("let t = 2 * cross(q_v, v);\nv + q.w * t + cross(q_v, t)"), 1);
        for text in [
            "let t = 2 * cross(q_v, v);\nv + q.w * t - cross(q_v, t)",
            "let t = 3 * cross(q_v, v);\nv + q.w * t + cross(q_v, t)",
            "let t = 2 * cross(v, q_v);\nv + q.w * t + cross(q_v, t)",
            "let t = 2 * cross(q_v, v);\nv + q.w * t + cross(t, q_v)",
            "let t = 2 * cross(q_v, v);\nq_v + q.w * t + cross(q_v, t)",
            "let t = 2 * cross(q_v, v);\nvec(v.y, v.z, v.x) + q.w * t + cross(q_v, t)",
            "let t = 2 * cross(q_v, v);\nvec(q.w, q.x, q.w) * 0 + v + vec(q.w * t.x, q.x * t.y, q.w * t.z) + cross(q_v, t)",
            "let t = 2 * cross(q_v, angular_velocity);\nv + q.w * t + cross(q_v, t)",
        ] {
            assert_eq!(turned(text), 0, "{text}");
        }
    }

    #[test]
    fn its_components_are_those_of_the_quaternion_to_the_bit() {
        let (q, v) = ([0.5, -0.1, 0.7, 0.3], [0.2, -3.0, 1e-9]);
        let quaternion = Quaternion::new(q[0], q[1], q[2], q[3]);
        let vector = Vector::new(v[0], v[1], v[2]);
        for (text, expected) in
            [("to_body(v)", quaternion.rotate_inverse(vector)), ("to_world(v)", quaternion.rotate(vector))]
        {
            // The attitude comes before the parameters.
            let found = program(text).evaluate_one(&[q[0], q[1], q[2], q[3], v[0], v[1], v[2]]);
            let expected: [f64; 3] = [expected.x, expected.y, expected.z];
            assert_eq!(found, expected, "{text}");
        }
    }
}

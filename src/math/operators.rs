//! Operators of number types, vectors and tensors, by a macro.

/// Implements operators whose result has the type of their left operand, forced inline. After the generics and the type each is written
/// `Trait::function(operands) = result;`.
macro_rules! operators {
    ($generics:tt $type:ty: $($trait:ident::$name:ident($self:ident $(, $other:ident: $kind:ty)?) = $result:expr;)+) => {
        $($crate::math::operators! { @one $generics $type, $trait $name $self ($($other $kind)?) $result })+
    };
    (@one [$($generics:tt)*] $type:ty, $trait:ident $name:ident $self:ident ($($other:ident $kind:ty)?) $result:expr) => {
        impl<$($generics)*> $trait$(<$kind>)? for $type {
            type Output = Self;
            #[inline(always)]
            fn $name($self $(, $other: $kind)?) -> Self {
                $result
            }
        }
    };
}

pub(crate) use operators;

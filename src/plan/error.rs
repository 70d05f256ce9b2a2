//! Errors of plans: each states what was given and what is allowed.

/// Why a plan was refused. Nothing has changed. Codes 600 and 604.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PlanError {
    /// A buffer would outgrow [`PlanLimits`](super::PlanLimits).
    #[error("{what} need a buffer of {needed} bytes; the limit is {limit}")]
    Full {
        /// What the buffer holds, in the plural.
        what: &'static str,
        /// Bytes that the buffer needs.
        needed: u64,
        /// Bytes of the largest buffer.
        limit: u64,
    },
    /// A plan was played twice, or another plan before it was left out.
    #[error("the plan with number {given} was given; number {expected} comes next")]
    OutOfOrder {
        /// [`FramePlan::number`](super::FramePlan::number) of the plan that has to be played next.
        expected: u64,
        /// The number of the given plan.
        given: u64,
    },
}

impl PlanError {
    /// The stable code, see [`error`](crate::error).
    pub fn code(&self) -> u32 {
        match self {
            Self::Full { .. } => 600,
            Self::OutOfOrder { .. } => 604,
        }
    }
}

/// The prefix cannot begin an ASCII identifier of WGSL. Code 900.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the prefix is {prefix:?}, which cannot begin an ASCII identifier of WGSL")]
#[non_exhaustive]
pub struct ShaderNameError {
    /// The given prefix.
    pub prefix: String,
}

impl ShaderNameError {
    /// The stable code, see [`error`](crate::error).
    pub fn code(&self) -> u32 {
        900
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_error_has_a_code_of_its_own() {
        let errors =
            [PlanError::Full { what: "nodes", needed: 2, limit: 1 }, PlanError::OutOfOrder { expected: 3, given: 5 }];
        assert_eq!(errors.map(|error| error.code()), [600, 604]);
        assert_eq!(errors[1].to_string(), "the plan with number 5 was given; number 3 comes next");
        assert_eq!(ShaderNameError { prefix: String::new() }.code(), 900);
    }
}

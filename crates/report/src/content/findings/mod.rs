//! The findings: the abstract and the answer to the experiment's question.

pub(crate) mod abstract_;
pub(crate) mod answer;

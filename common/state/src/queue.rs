//! A queue with a schema.

use std::collections::VecDeque;
use std::ops::{Deref, DerefMut};

use postcard_schema::Schema;
use postcard_schema::schema::{DataModelType, NamedType};
use serde::{Deserialize, Serialize};

/// A [`VecDeque`] as part of a state: the library of schemas knows none.
///
/// ```
/// use stillmap_state::{Queue, decode, encode};
///
/// let mut queue = Queue::default();
/// queue.push_back(7_u64);
/// assert_eq!(decode::<Queue<u64>>(&encode(&queue, Vec::new())), Ok(queue));
/// ```
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Queue<T>(VecDeque<T>);

impl<T> Default for Queue<T> {
    fn default() -> Self {
        Self(VecDeque::new())
    }
}

impl<T> Deref for Queue<T> {
    type Target = VecDeque<T>;

    fn deref(&self) -> &VecDeque<T> {
        &self.0
    }
}

impl<T> DerefMut for Queue<T> {
    fn deref_mut(&mut self) -> &mut VecDeque<T> {
        &mut self.0
    }
}

impl<T> FromIterator<T> for Queue<T> {
    fn from_iter<I: IntoIterator<Item = T>>(items: I) -> Self {
        Self(items.into_iter().collect())
    }
}

impl<T> IntoIterator for Queue<T> {
    type Item = T;
    type IntoIter = std::collections::vec_deque::IntoIter<T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.into_iter()
    }
}

impl<'a, T> IntoIterator for &'a Queue<T> {
    type Item = &'a T;
    type IntoIter = std::collections::vec_deque::Iter<'a, T>;

    fn into_iter(self) -> Self::IntoIter {
        self.0.iter()
    }
}

impl<T: Schema> Schema for Queue<T> {
    const SCHEMA: &'static NamedType = &NamedType { name: "Queue", ty: &DataModelType::Seq(T::SCHEMA) };
}

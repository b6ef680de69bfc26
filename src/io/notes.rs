//! Warnings of a reader: each kind said once, with the first line and how many.

/// Counts what happened by kind.
#[derive(Clone, Debug, Default)]
pub(crate) struct Notes {
    list: Vec<Note>,
}

#[derive(Clone, Debug)]
struct Note {
    what: String,
    line: usize,
    count: usize,
}

/// More kinds than this are put together: kinds may carry words of the input, which may be any number.
const KINDS: usize = 24;

impl Notes {
    /// Notes that `what` happened at `line`.
    pub(crate) fn at(&mut self, line: usize, what: &str) {
        let full = self.list.len() >= KINDS && !self.list.iter().any(|n| n.what == what);
        let kind = if full { "more of other kinds left out" } else { what };
        match self.list.iter_mut().find(|n| n.what == kind) {
            Some(note) => note.count += 1,
            None => self.list.push(Note { what: kind.to_string(), line, count: 1 }),
        }
    }

    /// One sentence for each kind, in order of first appearance.
    pub(crate) fn into_warnings(self) -> Vec<String> {
        let say = |n: Note| match n.count {
            1 => format!("line {}: {}", n.line, n.what),
            count => format!("line {} and {} more: {}", n.line, count - 1, n.what),
        };
        self.list.into_iter().map(say).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_kind_is_said_once() {
        let mut n = Notes::default();
        n.at(3, "a");
        n.at(5, "b");
        n.at(9, "a");
        assert_eq!(n.into_warnings(), ["line 3 and 1 more: a", "line 5: b"]);
    }

    #[test]
    fn any_number_of_kinds_is_a_short_list() {
        let mut n = Notes::default();
        for i in 0..1000 {
            n.at(i, &i.to_string());
        }
        assert_eq!(n.into_warnings().len(), KINDS + 1);
    }
}

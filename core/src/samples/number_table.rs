//! Tables of numbers as text: CSV as spreadsheets, ParaView and finite-element programs write it.

/// A table of numbers whose first line names the columns. Columns are separated by commas, semicolons or tabs, or, if
/// there are none of these, by blanks. Lines that are empty or start with `#` or `%` are skipped, quotes around names are
/// dropped. Cells become numbers when their column is used.
#[derive(Clone, Debug)]
pub struct NumberTable<'a> {
    names: Vec<String>,
    /// Number of each line, from 1, with its cells.
    rows: Vec<(usize, Vec<&'a str>)>,
}

/// A cell that is not a number.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("line {line}: `{text}` in the column `{column}` is not a finite number{}", if text.contains(',') { "; decimals are separated by a point" } else { "" })]
pub struct NotANumber {
    /// From 1.
    pub line: usize,
    /// Name of the column.
    pub column: String,
    /// Text of the cell; empty if the line ends before it.
    pub text: String,
}

impl<'a> NumberTable<'a> {
    /// Splits a text into cells.
    pub fn new(text: &'a str) -> Self {
        let text = text.strip_prefix('\u{feff}').unwrap_or(text);
        let is_data = |(_, line): &(usize, &str)| {
            let line = line.trim();
            !line.is_empty() && !line.starts_with(['#', '%'])
        };
        let mut lines = text.lines().enumerate().filter(is_data);
        let header = lines.next().map_or("", |(_, line)| line);
        let separator = [',', ';', '\t'].into_iter().find(|s| header.contains(*s));
        let cells = |line: &'a str| -> Vec<&'a str> {
            match separator {
                Some(separator) => line.split(separator).map(str::trim).collect(),
                None => line.split_whitespace().collect(),
            }
        };
        let name = |cell: &str| cell.trim_matches(['"', '\'']).trim().to_string();
        NumberTable {
            names: cells(header).into_iter().map(name).collect(),
            rows: lines.map(|(line, text)| (line + 1, cells(text))).collect(),
        }
    }

    /// Names of the columns.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The column of this name.
    pub fn find(&self, name: &str) -> Option<usize> {
        self.names.iter().position(|n| n == name)
    }

    /// Numbers of the lines with values, from 1.
    pub fn lines(&self) -> impl Iterator<Item = usize> + '_ {
        self.rows.iter().map(|(line, _)| *line)
    }

    /// The text of a cell; empty if the line ends before it.
    pub fn text(&self, row: usize, column: usize) -> &'a str {
        self.rows[row].1.get(column).copied().unwrap_or("")
    }

    /// The numbers of a column.
    ///
    /// # Errors
    /// The first cell that is not a finite number.
    pub fn column(&self, column: usize) -> Result<Vec<f64>, NotANumber> {
        let number = |row: usize| {
            let text = self.text(row, column);
            let value = text.parse::<f64>().ok().filter(|v| v.is_finite());
            value.ok_or_else(|| NotANumber {
                line: self.rows[row].0,
                column: self.names[column].clone(),
                text: text.into(),
            })
        };
        (0..self.rows.len()).map(number).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_different_programs_are_the_same_table() {
        for text in [
            "x,y,temperature\n0,1,300\n2,3,400\n",
            "\u{feff}x;y;temperature\r\n0;1;300\r\n\r\n2;3;4e2\r\n",
            "# measured\nx\ty\ttemperature\n0\t1\t300\n2\t3\t400",
            "% model\n  x   y  temperature\n 0  1   300.0\n 2  3  400",
            "\"x\", \"y\", \"temperature\"\n0, 1, 300\n#\n2, 3, 400",
        ] {
            let table = NumberTable::new(text);
            assert_eq!(table.names(), ["x", "y", "temperature"], "{text}");
            let column = table.find("temperature").expect(text);
            assert_eq!(table.column(column), Ok(vec![300.0, 400.0]), "{text}");
        }
    }

    #[test]
    fn a_cell_that_is_not_a_number_is_named_when_its_column_is_used() {
        let table = NumberTable::new("x;name;t\n0;left;3\n\n1;right;2,5\n2;end");
        assert_eq!(table.column(0), Ok(vec![0.0, 1.0, 2.0]));
        let error = table.column(2).expect_err("a comma").to_string();
        assert_eq!(
            error,
            "line 4: `2,5` in the column `t` is not a finite number; decimals are separated by a point"
        );
        assert_eq!(table.column(1).expect_err("text").line, 2);
        for cell in ["", "nan", "inf"] {
            let text = format!("x,t\n1,{cell}");
            assert!(NumberTable::new(&text).column(1).is_err(), "{cell}");
        }
    }
}

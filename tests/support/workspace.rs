//! A folder with a study in it, the command run there, and its results read back.

#![allow(dead_code, reason = "each test file uses a part of it")]

use std::collections::HashMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use assert_cmd::cargo::cargo_bin;
use glam::{DQuat, DVec3};
use tempfile::TempDir;

/// A folder with a study in it.
pub struct Workspace {
    folder: TempDir,
}

impl Workspace {
    pub fn new(study: &str) -> Self {
        let folder = tempfile::tempdir().expect("a temporary folder");
        fs::write(folder.path().join("study.toml"), study).expect("the study is written");
        Self { folder }
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        self.folder.path()
    }

    /// A file or folder in it.
    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Runs the command in the folder.
    pub fn polhode(&self, arguments: &[&str]) -> Output {
        Command::new(cargo_bin!("polhode"))
            .current_dir(self.folder.path())
            // Tests leave nothing in the user's own folders.
            .env("POLHODE_DEVICE_CACHE", "none")
            .args(arguments)
            .output()
            .expect("the command starts")
    }

    /// Runs the command, which must succeed and write nothing to standard error.
    pub fn done(&self, arguments: &[&str]) -> String {
        let output = self.polhode(arguments);
        let (text, errors) = (words(&output.stdout), words(&output.stderr));
        assert!(output.status.success(), "{arguments:?}: {errors}");
        assert_eq!(errors, "", "{arguments:?}");
        text
    }

    /// Runs the command, which must end with `status` and one line on standard error.
    pub fn refused(&self, arguments: &[&str], status: i32) -> String {
        let output = self.polhode(arguments);
        let errors = words(&output.stderr);
        assert_eq!(output.status.code(), Some(status), "{arguments:?}: {errors}");
        assert_eq!(errors.lines().count(), 1, "{arguments:?}: {errors}");
        assert!(errors.starts_with("error: "), "{arguments:?}: {errors}");
        errors
    }

    pub fn names(&self, folder: &str) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(self.path(folder))
            .expect("the folder is there")
            .map(|entry| entry.expect("an entry").file_name().into_string().expect("a name"))
            .collect();
        names.sort();
        names
    }
}

pub fn words(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).expect("text")
}

pub fn example(name: &str) -> String {
    format!("{}/examples/studies/{name}.toml", env!("CARGO_MANIFEST_DIR"))
}

/// A table of states by column.
#[derive(Debug)]
pub struct States {
    pub columns: HashMap<String, Vec<f64>>,
}

impl States {
    pub fn read(path: &Path) -> Self {
        let mut reader = csv::Reader::from_path(path).expect("a table");
        let header: Vec<String> = reader.headers().expect("a header").iter().map(str::to_owned).collect();
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); header.len()];
        for record in reader.records() {
            for (column, field) in columns.iter_mut().zip(record.expect("a row").iter()) {
                column.push(field.parse().expect("a number"));
            }
        }
        Self { columns: header.into_iter().zip(columns).collect() }
    }

    pub fn column(&self, name: &str) -> &[f64] {
        &self.columns[name]
    }

    pub fn rows(&self) -> usize {
        self.column("body").len()
    }

    pub fn vector(&self, names: [&str; 3], row: usize) -> DVec3 {
        DVec3::from_array(names.map(|name| self.column(name)[row]))
    }

    pub fn orientation(&self, row: usize) -> DQuat {
        DQuat::from_array(["qx", "qy", "qz", "qw"].map(|name| self.column(name)[row]))
    }

    /// Rows of one body.
    pub fn of_body(&self, body: usize) -> Vec<usize> {
        (0..self.rows()).filter(|&row| self.column("body")[row] == body as f64).collect()
    }
}

/// The report in a folder of results.
pub fn report(workspace: &Workspace, folder: &str) -> serde_json::Value {
    serde_json::from_str(&fs::read_to_string(workspace.path(folder).join("report.json")).expect("a report"))
        .expect("JSON")
}

//! Options as keyword arguments. Names and values are those of the command line, whose parser reads
//! them, so that a new option needs no line here.

use clap::builder::ArgAction;
use clap::{Arg, Args, Command, Parser};
use epsplat::options::{LimitOptions, Replacement};
use epsplat::{CameraOptions, DeviceOptions, RenderOptions, SceneOptions};
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyInt, PyString};

use crate::error::usage;

/// The options of `epsplat render` that describe a picture.
#[derive(Parser)]
#[command(no_binary_name = true, disable_help_flag = true, disable_version_flag = true)]
pub struct Options {
    #[command(flatten)]
    pub camera: CameraOptions,
    #[command(flatten)]
    pub render: RenderOptions,
    #[command(flatten)]
    pub scene: SceneOptions,
    #[command(flatten)]
    pub device: DeviceOptions,
}

/// The function or class that takes options.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Scope {
    Scene,
    Renderer,
    View,
    /// Functions that make surfels.
    Limits,
}

/// Options of the camera that a renderer takes for all its views.
const OF_ALL_VIEWS: [&str; 2] = ["size", "near"];

impl Scope {
    const ALL: [Self; 3] = [Self::Scene, Self::Renderer, Self::View];

    fn name(self) -> &'static str {
        match self {
            Self::Scene => "Scene and read",
            Self::Renderer => "Renderer",
            Self::View => "View and look_at",
            Self::Limits => "surfels and lod",
        }
    }

    /// The arguments of the scope.
    fn arguments(self) -> Vec<Arg> {
        let command = Command::new("epsplat");
        let all = |command: Command| command.get_arguments().cloned().collect::<Vec<_>>();
        match self {
            Self::Scene => all(SceneOptions::augment_args(command)),
            Self::Renderer => {
                let camera = all(CameraOptions::augment_args(command.clone())).into_iter();
                let camera = camera.filter(|arg| OF_ALL_VIEWS.contains(&arg.get_id().as_str()));
                all(DeviceOptions::augment_args(RenderOptions::augment_args(command)))
                    .into_iter()
                    .chain(camera)
                    .collect()
            }
            Self::View => all(CameraOptions::augment_args(command)),
            Self::Limits => all(LimitOptions::augment_args(command)),
        }
    }
}

/// Whether the keyword `name` stands for this argument.
fn is_named(arg: &Arg, name: &str) -> bool {
    // Words of Python, such as `from`, may end in an underscore.
    let name = name.trim_end_matches('_').replace('_', "-");
    arg.get_long() == Some(&name) || arg.get_all_aliases().is_some_and(|all| all.contains(&name.as_str()))
}

/// Converts keyword arguments to arguments of the command line.
pub fn arguments(scope: Scope, keywords: &Bound<'_, PyDict>) -> PyResult<Vec<String>> {
    let py = keywords.py();
    let known = scope.arguments();
    let mut arguments = Vec::new();
    for (name, value) in keywords {
        let name: String = name.extract()?;
        if value.is_none() {
            continue;
        }
        match known.iter().find(|arg| is_named(arg, &name)) {
            Some(arg) => push(arg, &value, &mut arguments)?,
            None => {
                let of = Scope::ALL.iter().find(|other| other.arguments().iter().any(|arg| is_named(arg, &name)));
                return Err(match of {
                    Some(other) => usage(py, &format!("{name} is an option of {}: give it there", other.name())),
                    // The parser knows a similar name, if there is one.
                    None => match parsed(py, &[format!("--{}", name.replace('_', "-"))]) {
                        Err(error) => error,
                        Ok(_) => usage(py, &format!("there is no option {name}")),
                    },
                });
            }
        }
    }
    Ok(arguments)
}

/// Appends the arguments that give `arg` its value.
fn push(arg: &Arg, value: &Bound<'_, PyAny>, arguments: &mut Vec<String>) -> PyResult<()> {
    let (long, value) = (arg.get_long().unwrap_or_default(), &plain(value)?);
    let bare =
        matches!(arg.get_action(), ArgAction::SetTrue) || arg.get_num_args().is_some_and(|n| n.min_values() == 0);
    if let Ok(switch) = value.cast::<PyBool>()
        && bare
    {
        if switch.is_true() {
            arguments.push(format!("--{long}"));
        }
        return Ok(());
    }
    if let Ok(rows) = value.cast::<PyDict>() {
        for (key, value) in rows {
            arguments.push(format!("--{long}={}={}", text(&key, ",")?, text(&value, ",")?));
        }
        return Ok(());
    }
    let is_list = matches!(arg.get_action(), ArgAction::Append);
    let items = items(value)?;
    if items.as_ref().is_some_and(Vec::is_empty) {
        return Ok(());
    }
    if let Some(items) = items.filter(|items| is_list && !items.iter().all(is_number)) {
        for item in items {
            arguments.push(format!("--{long}={}", text(&item, ",")?));
        }
        return Ok(());
    }
    let between = if long == "size" { "x" } else { "," };
    arguments.push(format!("--{long}={}", text(value, between)?));
    Ok(())
}

/// The value, or the number of Python in the place of one of numpy.
fn plain<'py>(value: &Bound<'py, PyAny>) -> PyResult<Bound<'py, PyAny>> {
    let axes = value.getattr_opt("ndim")?.and_then(|axes| axes.extract::<usize>().ok());
    if axes == Some(0) { value.call_method0("tolist") } else { Ok(value.clone()) }
}

fn is_number(value: &Bound<'_, PyAny>) -> bool {
    value.is_instance_of::<PyInt>() || value.is_instance_of::<PyFloat>()
}

/// The items of a sequence or an array; None for other values.
fn items<'py>(value: &Bound<'py, PyAny>) -> PyResult<Option<Vec<Bound<'py, PyAny>>>> {
    if value.is_instance_of::<PyString>() || value.hasattr("__fspath__")? {
        return Ok(None);
    }
    let value = if value.hasattr("tolist")? { value.call_method0("tolist")? } else { value.clone() };
    match value.try_iter() {
        Ok(items) => items.map(|item| plain(&item?)).collect::<PyResult<Vec<_>>>().map(Some),
        Err(_) => Ok(None),
    }
}

/// The text of a value; the items of a sequence stand with `between` between them.
fn text(value: &Bound<'_, PyAny>, between: &str) -> PyResult<String> {
    if let Ok(switch) = value.cast::<PyBool>() {
        return Ok(switch.is_true().to_string());
    }
    if value.is_instance_of::<PyString>() {
        return value.extract();
    }
    if value.hasattr("__fspath__")? {
        return value.call_method0("__fspath__")?.extract();
    }
    if value.is_instance_of::<PyInt>() {
        return Ok(value.str()?.to_string());
    }
    if let Some(items) = items(value)? {
        return Ok(items.iter().map(|item| text(item, ",")).collect::<PyResult<Vec<_>>>()?.join(between));
    }
    match value.extract::<f64>() {
        Ok(number) => Ok(number.to_string()),
        Err(_) => Ok(value.str()?.to_string()),
    }
}

/// Parses arguments of the command line.
pub fn parsed(py: Python<'_>, arguments: &[String]) -> PyResult<Options> {
    Options::try_parse_from(arguments).map_err(|error| usage(py, &sentence(&error.to_string())))
}

/// The sentence of a parser's error, in one line, without hints at `--help`.
fn sentence(error: &str) -> String {
    let error = error.strip_prefix("error: ").unwrap_or(error);
    let ends = ["\n\nUsage:", "\n\nFor more information"];
    let end = ends.iter().filter_map(|end| error.find(end)).min().unwrap_or(error.len());
    error[..end].split_whitespace().collect::<Vec<_>>().join(" ")
}

/// Adds WGSL texts, by the names of the files that they replace.
pub fn replace(options: &mut RenderOptions, wgsl: Option<&Bound<'_, PyDict>>) -> PyResult<()> {
    for (file, text) in wgsl.into_iter().flatten() {
        options.research.sources.push(Replacement::new(file.extract::<String>()?, text.extract::<String>()?));
    }
    Ok(())
}

//! Reflection of WGSL modules: the variables that each entry point binds, and their wgpu layout.

use std::borrow::Cow;
use std::collections::BTreeMap;

use naga::valid::{Capabilities, ModuleInfo, ValidationError, ValidationFlags, Validator};
use naga::{AddressSpace, Handle, ImageClass, ImageDimension, Module, ScalarKind, StorageAccess, TypeInner, WithSpan};

use super::exact::{self, Needs};

/// The bindings of each entry point: the names of its variables and their numbers. The numbers are
/// those of the WGSL source, or, in a compiled [`Program`](super::program::Program), those of its
/// pipelines.
pub type Bindings = BTreeMap<String, Vec<(String, u32)>>;

/// Why a text is no valid module.
#[derive(Debug)]
pub(super) struct Invalid {
    sentence: String,
    /// The place of the fault in the text.
    at: Option<naga::SourceLocation>,
}

impl Invalid {
    /// Returns the line and column of the fault, and the sentence.
    pub fn parts(self) -> (Option<(u32, u32)>, String) {
        (self.at.map(|at| (at.line_number, at.line_position)), self.sentence)
    }

    /// Returns the sentence, preceded by the place of the fault. `place_of` maps a line of the text
    /// to a file and a line in that file.
    pub fn told<'a>(&self, place_of: impl Fn(u32) -> Option<(&'a str, u32)>) -> String {
        let at = self.at.as_ref();
        let place = at.and_then(|at| Some((place_of(at.line_number)?, at.line_position)));
        match place {
            Some(((file, line), column)) => format!("{file}:{line}:{column}: {}", self.sentence),
            None => self.sentence.clone(),
        }
    }
}

/// Returns an error's message and those of its causes.
fn sentence(error: &dyn std::error::Error) -> String {
    let causes = std::iter::successors(Some(error), |error| error.source());
    causes.map(ToString::to_string).collect::<Vec<_>>().join(": ")
}

/// A parsed and validated module.
pub(super) struct Interface {
    pub module: Module,
    pub info: ModuleInfo,
}

impl Interface {
    /// Parses and validates `text`, which may use `capabilities`.
    ///
    /// # Errors
    /// The parser's or validator's message, and its place.
    pub fn of(text: &str, capabilities: Capabilities) -> Result<Self, Invalid> {
        let module = naga::front::wgsl::parse_str(text).map_err(|error| {
            let labels = error.labels().filter(|(_, label)| !label.is_empty()).map(|(_, label)| label.to_owned());
            let sentence = [error.message().to_owned()].into_iter().chain(labels).collect::<Vec<_>>().join(": ");
            Invalid { sentence, at: error.location(text) }
        })?;
        Self::validated(module, capabilities)
            .map_err(|(sentence, error)| Invalid { sentence, at: error.location(text) })
    }

    /// Validates a module, which may use `capabilities`.
    ///
    /// # Errors
    /// The validator's error, and its causes in a sentence.
    pub fn validated(
        module: Module,
        capabilities: Capabilities,
    ) -> Result<Self, (String, Box<WithSpan<ValidationError>>)> {
        match Validator::new(ValidationFlags::all(), capabilities).validate(&module) {
            Ok(info) => Ok(Self { module, info }),
            Err(error) => Err((sentence(error.as_inner()), Box::new(error))),
        }
    }

    /// Returns the module with the operations that `needs` say replaced by functions whose bits
    /// every adapter shares.
    ///
    /// # Errors
    /// A message if the module cannot be rewritten.
    pub fn settled(&self, capabilities: Capabilities, needs: Needs) -> Result<Self, String> {
        let module = exact::settle(&self.module, &self.info, needs)?;
        Self::validated(module, capabilities).map_err(|(sentence, _)| sentence)
    }

    /// Returns WGSL of one entry point, with `constants` set.
    ///
    /// # Errors
    /// A message if a constant has no value or does not fit.
    pub fn text_of(&self, entry: (naga::ShaderStage, &str), constants: &[(&str, f64)]) -> Result<String, String> {
        let (module, info) = self.resolved(entry, constants)?;
        naga::back::wgsl::write_string(&module, &info, naga::back::wgsl::WriterFlags::empty())
            .map_err(|e| e.to_string())
    }

    /// Returns the part of the module that one entry point uses, with `constants` set.
    ///
    /// # Errors
    /// A message if a constant has no value or does not fit.
    pub fn resolved(
        &self,
        entry: (naga::ShaderStage, &str),
        constants: &[(&str, f64)],
    ) -> Result<(Cow<'_, Module>, Cow<'_, ModuleInfo>), String> {
        let constants = constants.iter().map(|&(name, value)| (name.to_owned(), value)).collect();
        naga::back::pipeline_constants::process_overrides(&self.module, &self.info, Some(entry), &constants)
            .map_err(|e| sentence(&e))
    }

    /// Returns the names of the module's overrides.
    pub fn overrides(&self) -> Vec<String> {
        self.module.overrides.iter().filter_map(|(_, o)| o.name.clone()).collect()
    }

    /// Returns the bindings of the module's entry points.
    pub fn bindings(&self) -> Bindings {
        let variables = &self.module.global_variables;
        let named = |handle: Handle<naga::GlobalVariable>| {
            Some((variables[handle].name.clone()?, variables[handle].binding.as_ref()?.binding))
        };
        let of = |(index, entry): (usize, &naga::EntryPoint)| {
            (entry.name.clone(), self.bound(index).filter_map(named).collect::<Vec<_>>())
        };
        self.module.entry_points.iter().enumerate().map(of).collect()
    }

    /// Returns the variables with a binding that the entry point of index `entry` uses.
    fn bound(&self, entry: usize) -> impl Iterator<Item = Handle<naga::GlobalVariable>> + '_ {
        let uses = self.info.get_entry_point(entry);
        let bound = |(handle, variable): &(Handle<naga::GlobalVariable>, &naga::GlobalVariable)| {
            variable.binding.is_some() && !uses[*handle].is_empty()
        };
        self.module.global_variables.iter().filter(bound).map(|(handle, _)| handle)
    }

    /// Returns the variables that one pipeline binds, with names and layout, in the order of their
    /// binding numbers. `entries` are the pipeline's entry points, each with its stage.
    ///
    /// # Errors
    /// A message if an entry point is missing, two variables have the same number, or a variable
    /// cannot be bound.
    pub fn layout(
        &self,
        entries: &[(wgpu::ShaderStages, &str)],
    ) -> Result<Vec<(String, wgpu::BindGroupLayoutEntry)>, String> {
        let mut layout: BTreeMap<u32, (String, wgpu::BindGroupLayoutEntry)> = BTreeMap::new();
        for &(stage, name) in entries {
            let entry = self.module.entry_points.iter().position(|entry| entry.name == name);
            for handle in self.bound(entry.ok_or_else(|| format!("there is no entry point {name}"))?) {
                let variable = &self.module.global_variables[handle];
                let (Some(name), Some(naga::ResourceBinding { binding, .. })) = (&variable.name, variable.binding)
                else {
                    continue;
                };
                let new =
                    wgpu::BindGroupLayoutEntry { binding, visibility: stage, ty: self.kind(handle)?, count: None };
                let known = layout.entry(binding).or_insert_with(|| (name.clone(), new));
                if known.0 != *name {
                    return Err(format!("{} and {name} have the same binding number", known.0));
                }
                known.1.visibility |= stage;
            }
        }
        Ok(layout.into_values().collect())
    }

    /// Checks that the fragment shader reads only what the vertex shader writes, and that its
    /// outputs match `targets`.
    ///
    /// # Errors
    /// A message about the input or output that does not match.
    pub fn check_stages(
        &self,
        [vertex, fragment]: [&str; 2],
        targets: &[wgpu::ColorTargetState],
    ) -> Result<(), String> {
        let function = |name: &str| {
            let entry = self.module.entry_points.iter().find(|entry| entry.name == name);
            entry.map(|entry| &entry.function).ok_or_else(|| format!("there is no entry point {name}"))
        };
        let (vertex, fragment) = (function(vertex)?, function(fragment)?);
        let results = |function: &naga::Function| {
            function
                .result
                .iter()
                .flat_map(|result| self.places(result.ty, result.binding.as_ref()))
                .collect::<Vec<_>>()
        };
        let handed = results(vertex);
        for taken in fragment.arguments.iter().flat_map(|given| self.places(given.ty, given.binding.as_ref())) {
            if !handed.contains(&taken) {
                return Err(format!(
                    "the fragment shader reads location {}, which the vertex shader does not write",
                    taken.0
                ));
            }
        }
        let kind = |target: &wgpu::ColorTargetState| match target.format.sample_type(None, None) {
            Some(wgpu::TextureSampleType::Uint) => ScalarKind::Uint,
            Some(wgpu::TextureSampleType::Sint) => ScalarKind::Sint,
            _ => ScalarKind::Float,
        };
        let wanted: Vec<_> = (0..).zip(targets).map(|(place, target)| (place, Some(kind(target)))).collect();
        let scalar = |ty: Handle<naga::Type>| self.module.types[ty].inner.scalar_kind();
        let mut made: Vec<_> = results(fragment).into_iter().map(|(place, ty)| (place, scalar(ty))).collect();
        made.sort_by_key(|(place, _)| *place);
        if made == wanted { Ok(()) } else { Err("the fragment shader's outputs do not match the targets".into()) }
    }

    /// Returns location and type of each value that a result or an argument passes between stages:
    /// the value itself, or the members of a struct.
    fn places(&self, ty: Handle<naga::Type>, binding: Option<&naga::Binding>) -> Vec<(u32, Handle<naga::Type>)> {
        let place = |binding: Option<&naga::Binding>| match binding {
            Some(naga::Binding::Location { location, .. }) => Some(*location),
            _ => None,
        };
        match &self.module.types[ty].inner {
            TypeInner::Struct { members, .. } => {
                members.iter().filter_map(|member| Some((place(member.binding.as_ref())?, member.ty))).collect()
            }
            _ => place(binding).map(|place| (place, ty)).into_iter().collect(),
        }
    }

    /// Returns the binding type of a variable.
    fn kind(&self, handle: Handle<naga::GlobalVariable>) -> Result<wgpu::BindingType, String> {
        let variable = &self.module.global_variables[handle];
        let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
        match (variable.space, &self.module.types[variable.ty].inner) {
            (AddressSpace::Uniform, _) => Ok(buffer(wgpu::BufferBindingType::Uniform)),
            (AddressSpace::Storage { access }, _) => {
                Ok(buffer(wgpu::BufferBindingType::Storage { read_only: !access.contains(StorageAccess::STORE) }))
            }
            (
                _,
                &TypeInner::Image {
                    dim: ImageDimension::D2,
                    arrayed: false,
                    class: ImageClass::Sampled { kind, multi: false },
                },
            ) => Ok(wgpu::BindingType::Texture {
                sample_type: match kind {
                    ScalarKind::Uint => wgpu::TextureSampleType::Uint,
                    ScalarKind::Sint => wgpu::TextureSampleType::Sint,
                    _ => wgpu::TextureSampleType::Float { filterable: false },
                },
                view_dimension: wgpu::TextureViewDimension::D2,
                multisampled: false,
            }),
            _ => Err(format!("{} is neither a buffer nor a texture", variable.name.as_deref().unwrap_or("a variable"))),
        }
    }
}

/// Parses and validates a module. Returns it, the bindings of its entry points and the names of its
/// overrides.
pub fn reflect(text: &str) -> Result<(Module, Bindings, Vec<String>), String> {
    let interface =
        Interface::of(text, Capabilities::all()).map_err(|invalid| invalid.told(|line| Some(("line", line))))?;
    let (bindings, overrides) = (interface.bindings(), interface.overrides());
    Ok((interface.module, bindings, overrides))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    const DRAWN: &str = "
        struct Corner { @builtin(position) place: vec4<f32>, @location(1) color: vec4<f32> }
        @vertex fn corner() -> Corner { return Corner(vec4<f32>(0.0), vec4<f32>(1.0)); }
        @fragment fn shown(@location(1) color: vec4<f32>) -> @location(0) vec4<f32> { return color; }";

    #[test]
    fn stages_that_do_not_fit_are_refused() {
        let fits = |text: &str, targets: &[wgpu::TextureFormat]| {
            let targets: Vec<wgpu::ColorTargetState> = targets.iter().map(|&format| format.into()).collect();
            let interface = Interface::of(text, Capabilities::empty()).unwrap();
            interface.check_stages(["corner", "shown"], &targets).is_ok()
        };
        use wgpu::TextureFormat::{R32Uint, Rgba16Float};
        assert!(fits(DRAWN, &[Rgba16Float]));
        for targets in [&[R32Uint][..], &[], &[Rgba16Float, Rgba16Float]] {
            assert!(!fits(DRAWN, targets), "{targets:?}");
        }
        for (from, to) in [
            ("shown(@location(1)", "shown(@location(2)"),
            (
                "shown(@location(1) color: vec4<f32>) -> @location(0) vec4<f32> { return color; }",
                "shown(@location(1) color: vec2<f32>) -> @location(0) vec4<f32> { return color.xyxy; }",
            ),
            ("-> @location(0)", "-> @location(1)"),
        ] {
            assert!(DRAWN.contains(from) && !fits(&DRAWN.replace(from, to), &[Rgba16Float]), "{to}");
        }
    }

    #[test]
    fn two_variables_of_one_number_are_refused() {
        let text = "
            @group(0) @binding(2) var<uniform> one: vec4<f32>;
            @group(0) @binding(2) var<uniform> other: vec4<f32>;
            @vertex fn corner() -> @builtin(position) vec4<f32> { return one; }
            @fragment fn shown() -> @location(0) vec4<f32> { return other; }";
        let stages = [(wgpu::ShaderStages::VERTEX, "corner"), (wgpu::ShaderStages::FRAGMENT, "shown")];
        let interface = Interface::of(text, Capabilities::empty()).unwrap();
        assert!(interface.layout(&stages).is_err() && interface.layout(&stages[..1]).unwrap().len() == 1);
    }
}

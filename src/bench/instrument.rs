//! Counters in a kernel's SPIR-V: what its invocations do, on any device and without a change to the GLSL.
//!
//! A run of a basic block always does the same, so each invocation adds that up for itself, block by block, and adds its
//! sums to the buffer's when it returns. What is counted is what the module asks for, as spirv-opt left it: a driver may
//! still drop what nothing needs, and caches may serve what is asked for again.

use crate::{Error, Result, shared::Slot};
use rspirv::{
    binary::{Assemble, Consumer, ParseAction, parse_words},
    dr::{Instruction, ModuleHeader, Operand},
    spirv::{Decoration, GlslStd450Op, Op, StorageClass},
};
use std::{
    collections::{BTreeMap, BTreeSet, HashMap},
    ops::AddAssign,
};

/// Words of a module's counters: low and high half of each of [`Work`]'s sums.
pub const COUNTER_WORDS: u32 = 8;

/// What is done: by one run of a block, or by many.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Work {
    /// Bytes loaded from storage buffers.
    pub loaded: u64,
    /// Bytes stored to storage buffers.
    pub stored: u64,
    /// Operations on f32: each component of + - * / and of a root or other function counts one, a fused multiply-add two,
    /// a dot product of n components 2 n - 1. Comparisons, choices, minima, signs, roundings and conversions count nothing.
    pub flops: u64,
    /// Rays with a segment to search.
    pub rays: u64,
}

impl Work {
    /// Loaded and stored.
    pub fn bytes(self) -> u64 {
        self.loaded + self.stored
    }

    fn sums(self) -> [u64; 4] {
        [self.loaded, self.stored, self.flops, self.rays]
    }

    /// What [`COUNTER_WORDS`] words say.
    pub(super) fn of_words(words: &[u32]) -> Option<Work> {
        let [a, b, c, d, e, f, g, h] = words.try_into().ok()?;
        let [loaded, stored, flops, rays] =
            [[a, b], [c, d], [e, f], [g, h]].map(|[low, high]: [u32; 2]| u64::from(high) << 32 | u64::from(low));
        Some(Work { loaded, stored, flops, rays })
    }
}

impl AddAssign for Work {
    fn add_assign(&mut self, other: Work) {
        self.loaded += other.loaded;
        self.stored += other.stored;
        self.flops += other.flops;
        self.rays += other.rays;
    }
}

/// Header and instructions in order; rspirv's own loader does not know where OpExecutionModeId belongs.
#[derive(Default)]
struct Module {
    header: Option<ModuleHeader>,
    instructions: Vec<Instruction>,
}

impl Consumer for Module {
    fn initialize(&mut self) -> ParseAction {
        ParseAction::Continue
    }
    fn finalize(&mut self) -> ParseAction {
        ParseAction::Continue
    }
    fn consume_header(&mut self, header: ModuleHeader) -> ParseAction {
        self.header = Some(header);
        ParseAction::Continue
    }
    fn consume_instruction(&mut self, instruction: Instruction) -> ParseAction {
        self.instructions.push(instruction);
        ParseAction::Continue
    }
}

/// `spirv` with counters in [`Slot::Counters`], [`COUNTER_WORDS`] from the word `first` on. Traversal says there, where its
/// features ask for it, how many steps it took, once for each ray that it follows; so rays are counted.
///
/// # Errors
/// [`Error::Setting`] for what is no SPIR-V module, or has no entry point.
pub fn instrument(stem: &str, spirv: &[u8], first: u32) -> Result<Vec<u8>> {
    let wrong = |problem: &str| Error::setting(format!("SPIR-V of `{stem}`"), problem);
    let mut module = Module::default();
    let words: Vec<u32> = bytemuck::pod_collect_to_vec(spirv);
    parse_words(&words, &mut module).map_err(|state| wrong(&format!("cannot be read: {state}")))?;
    let mut header = module.header.ok_or_else(|| wrong("has no header"))?;
    let types = Types::of(&module.instructions);
    let entry = module.instructions.iter().find(|instruction| instruction.class.opcode == Op::EntryPoint);
    let entry = entry.and_then(|entry| id(entry.operands.get(1))).ok_or_else(|| wrong("has no entry point"))?;

    // What each block does, in order.
    let mut blocks: Vec<Work> = Vec::new();
    for instruction in &module.instructions {
        if instruction.class.opcode == Op::Label {
            blocks.push(Work::default());
        } else if let Some(block) = blocks.last_mut() {
            *block += types.work(instruction);
        }
    }
    let mut ids = Ids(header.bound);
    let counters = Counters::new(&mut ids, &types, first, &blocks).ok_or_else(|| wrong("has no unsigned integers"))?;

    let mut out: Vec<Instruction> = Vec::with_capacity(2 * module.instructions.len());
    let mut blocks = blocks.into_iter();
    // What the block does is to be added before its next instruction that may follow.
    let mut pending = None;
    let (mut annotated, mut declared, mut function) = (false, false, 0);
    for mut instruction in module.instructions {
        let opcode = instruction.class.opcode;
        if !annotated && matches!(opcode, Op::Decorate | Op::MemberDecorate) {
            out.extend(counters.annotations());
            annotated = true;
        }
        if opcode == Op::Function {
            function = instruction.result_id.unwrap_or(0);
            if !declared {
                out.extend(counters.declarations());
                declared = true;
            }
        }
        if opcode == Op::EntryPoint {
            instruction.operands.extend(counters.variables().map(Operand::IdRef));
        }
        if !matches!(opcode, Op::Phi | Op::Variable | Op::Line | Op::NoLine) {
            let work: Option<Work> = pending.take();
            out.extend(work.into_iter().flat_map(|work| counters.count(&mut ids, work)));
        }
        if opcode == Op::Label {
            pending = blocks.next();
        }
        if opcode == Op::Return && function == entry {
            out.extend(counters.flush(&mut ids));
        }
        out.push(instruction);
    }
    header.bound = ids.0;
    let mut words = header.assemble();
    for instruction in &out {
        instruction.assemble_into(&mut words);
    }
    Ok(bytemuck::cast_slice(&words).to_vec())
}

fn id(operand: Option<&Operand>) -> Option<u32> {
    match operand {
        Some(Operand::IdRef(id)) => Some(*id),
        _ => None,
    }
}

fn number(operand: Option<&Operand>) -> Option<u32> {
    match operand {
        Some(Operand::LiteralBit32(value)) => Some(*value),
        _ => None,
    }
}

/// New ids.
struct Ids(u32);

impl Ids {
    fn next(&mut self) -> u32 {
        self.0 += 1;
        self.0 - 1
    }
}

/// A type, by what is asked of it.
#[derive(Clone, Copy, Debug, Default)]
struct Type {
    /// In a buffer.
    bytes: u64,
    /// Components of f32; 0 for other types.
    floats: u64,
    /// Where a pointer points.
    class: Option<StorageClass>,
    pointee: u32,
}

/// What is known of a module's ids.
struct Types {
    types: HashMap<u32, Type>,
    /// Type of each value.
    values: HashMap<u32, u32>,
    /// Variable of each pointer.
    roots: HashMap<u32, u32>,
    /// Slot of each variable.
    slots: HashMap<u32, u32>,
    uint: Option<u32>,
    bool: Option<u32>,
}

impl Types {
    fn of(instructions: &[Instruction]) -> Types {
        let mut found = Types {
            types: HashMap::new(),
            values: HashMap::new(),
            roots: HashMap::new(),
            slots: HashMap::new(),
            uint: None,
            bool: None,
        };
        let mut constants: HashMap<u32, u64> = HashMap::new();
        for instruction in instructions {
            let operands = &instruction.operands;
            let Some(result) = instruction.result_id else {
                if let [
                    Operand::IdRef(variable),
                    Operand::Decoration(Decoration::Binding),
                    Operand::LiteralBit32(slot),
                ] = operands[..]
                {
                    found.slots.insert(variable, slot);
                }
                continue;
            };
            let get = |operand: Option<&Operand>| {
                id(operand).and_then(|id| found.types.get(&id)).copied().unwrap_or_default()
            };
            let several = |inner: Type, count: u64| Type { bytes: inner.bytes * count, ..Type::default() };
            let made = match instruction.class.opcode {
                Op::TypeBool => {
                    found.bool = Some(result);
                    Type::default()
                }
                Op::TypeInt => {
                    let width = number(operands.first()).unwrap_or(32);
                    if (width, number(operands.get(1))) == (32, Some(0)) {
                        found.uint = Some(result);
                    }
                    Type { bytes: u64::from(width / 8), ..Type::default() }
                }
                Op::TypeFloat => {
                    let width = number(operands.first()).unwrap_or(32);
                    Type { bytes: u64::from(width / 8), floats: (width == 32).into(), ..Type::default() }
                }
                Op::TypeVector | Op::TypeMatrix => {
                    let (inner, count) = (get(operands.first()), number(operands.get(1)).unwrap_or(1).into());
                    Type { floats: inner.floats * count, ..several(inner, count) }
                }
                Op::TypeArray => {
                    let count = id(operands.get(1)).and_then(|id| constants.get(&id)).copied();
                    several(get(operands.first()), count.unwrap_or(1))
                }
                // Layouts are scalar, without padding.
                Op::TypeStruct => {
                    Type { bytes: operands.iter().map(|member| get(Some(member)).bytes).sum(), ..Type::default() }
                }
                Op::TypePointer => {
                    let class = match operands.first() {
                        Some(Operand::StorageClass(class)) => Some(*class),
                        _ => None,
                    };
                    Type { class, pointee: id(operands.get(1)).unwrap_or(0), ..Type::default() }
                }
                opcode => {
                    if matches!(opcode, Op::Constant | Op::SpecConstant) {
                        constants.insert(result, number(operands.first()).unwrap_or(1).into());
                    }
                    let root = match opcode {
                        Op::Variable => Some(result),
                        Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject => {
                            id(operands.first()).and_then(|base| found.roots.get(&base)).copied()
                        }
                        _ => None,
                    };
                    found.roots.extend(root.map(|root| (result, root)));
                    found.values.extend(instruction.result_type.map(|type_id| (result, type_id)));
                    continue;
                }
            };
            found.types.insert(result, made);
        }
        found
    }

    fn of_value(&self, value: Option<&Operand>) -> Type {
        let type_id = id(value).and_then(|value| self.values.get(&value));
        type_id.and_then(|id| self.types.get(id)).copied().unwrap_or_default()
    }

    /// Bytes of what a pointer into a storage buffer points to; 0 for other pointers, and for counters.
    fn pointed(&self, pointer: Option<&Operand>) -> u64 {
        let pointed = self.of_value(pointer);
        if pointed.class != Some(StorageClass::StorageBuffer) || self.is_counter(pointer) {
            return 0;
        }
        self.types.get(&pointed.pointee).map_or(0, |pointee| pointee.bytes)
    }

    fn is_counter(&self, pointer: Option<&Operand>) -> bool {
        let root = id(pointer).and_then(|pointer| self.roots.get(&pointer));
        root.and_then(|root| self.slots.get(root)) == Some(&(Slot::Counters as u32))
    }

    /// What one execution of an instruction does.
    fn work(&self, instruction: &Instruction) -> Work {
        let operands = &instruction.operands;
        let floats = || instruction.result_type.and_then(|id| self.types.get(&id)).map_or(0, |found| found.floats);
        let flops = |flops: u64| Work { flops, ..Work::default() };
        match instruction.class.opcode {
            Op::Load => Work { loaded: self.pointed(operands.first()), ..Work::default() },
            Op::Store => Work { stored: self.pointed(operands.first()), ..Work::default() },
            Op::AtomicLoad => Work { loaded: self.pointed(operands.first()), ..Work::default() },
            Op::AtomicStore => Work { stored: self.pointed(operands.first()), ..Work::default() },
            Op::AtomicUMax if self.is_counter(operands.first()) => Work { rays: 1, ..Work::default() },
            Op::AtomicIAdd
            | Op::AtomicISub
            | Op::AtomicUMax
            | Op::AtomicUMin
            | Op::AtomicSMax
            | Op::AtomicSMin
            | Op::AtomicAnd
            | Op::AtomicOr
            | Op::AtomicXor
            | Op::AtomicExchange
            | Op::AtomicCompareExchange
            | Op::AtomicIIncrement
            | Op::AtomicIDecrement => {
                let bytes = self.pointed(operands.first());
                Work { loaded: bytes, stored: bytes, ..Work::default() }
            }
            Op::FAdd
            | Op::FSub
            | Op::FMul
            | Op::FDiv
            | Op::FRem
            | Op::FMod
            | Op::VectorTimesScalar
            | Op::MatrixTimesScalar
            | Op::OuterProduct => flops(floats()),
            Op::Dot => flops((2 * self.of_value(operands.first()).floats).saturating_sub(1)),
            // A dot product for each component.
            Op::MatrixTimesVector => {
                let inner = self.of_value(operands.get(1)).floats;
                flops(floats() * (2 * inner).saturating_sub(1))
            }
            Op::VectorTimesMatrix => {
                let inner = self.of_value(operands.first()).floats;
                flops(floats() * (2 * inner).saturating_sub(1))
            }
            Op::ExtInst => {
                let Some(Operand::LiteralExtInstInteger(function)) = operands.get(1) else { return Work::default() };
                let n = self.of_value(operands.get(2)).floats;
                flops(GlslStd450Op::from_u32(*function).map_or(0, |function| function_flops(function, floats(), n)))
            }
            _ => Work::default(),
        }
    }
}

/// Of a function of GLSL.std.450 whose result has so many components of f32, and whose first argument has `n`.
fn function_flops(function: GlslStd450Op, result: u64, n: u64) -> u64 {
    use GlslStd450Op as F;
    match function {
        F::Sin
        | F::Cos
        | F::Tan
        | F::Asin
        | F::Acos
        | F::Atan
        | F::Sinh
        | F::Cosh
        | F::Tanh
        | F::Asinh
        | F::Acosh
        | F::Atanh
        | F::Atan2
        | F::Pow
        | F::Exp
        | F::Log
        | F::Exp2
        | F::Log2
        | F::Sqrt
        | F::InverseSqrt
        | F::Ldexp
        | F::Radians
        | F::Degrees
        | F::Fract => result,
        F::Fma => 2 * result,
        // x + a (y - x).
        F::FMix => 3 * result,
        // Dot product and root; with the difference; with the quotients.
        F::Length => 2 * n,
        F::Distance | F::Normalize => 3 * n,
        F::Cross => 9,
        // x - 2 dot(n, x) n.
        F::Reflect => 4 * n,
        _ => 0,
    }
}

/// The buffer with the counters, an invocation's own sums, and the constants that counting needs.
struct Counters {
    buffer: u32,
    structure: u32,
    array: u32,
    of_structure: u32,
    of_word: u32,
    of_own: u32,
    own: [u32; 4],
    uint: u32,
    /// Of comparisons, and whether the module lacks it.
    bool: (u32, bool),
    /// Id of each constant.
    constants: BTreeMap<u32, u32>,
    first: u32,
}

impl Counters {
    /// None without unsigned integers, which no kernel does without.
    fn new(ids: &mut Ids, types: &Types, first: u32, blocks: &[Work]) -> Option<Counters> {
        // Scope of the device, relaxed semantics and what carries are 1 and 0.
        let mut values: BTreeSet<u32> = [0, 1].into();
        values.extend(first..first + COUNTER_WORDS);
        values.extend(blocks.iter().flat_map(|block| block.sums()).map(|sum| sum as u32));
        Some(Counters {
            uint: types.uint?,
            bool: types.bool.map_or_else(|| (ids.next(), true), |found| (found, false)),
            buffer: ids.next(),
            structure: ids.next(),
            array: ids.next(),
            of_structure: ids.next(),
            of_word: ids.next(),
            of_own: ids.next(),
            own: [(); 4].map(|()| ids.next()),
            constants: values.into_iter().map(|value| (value, ids.next())).collect(),
            first,
        })
    }

    /// What an entry point names of them.
    fn variables(&self) -> impl Iterator<Item = u32> {
        [self.buffer].into_iter().chain(self.own)
    }

    fn annotations(&self) -> Vec<Instruction> {
        let decorate = |target, decoration, value: Option<u32>| {
            let mut operands = vec![Operand::IdRef(target), Operand::Decoration(decoration)];
            operands.extend(value.map(Operand::LiteralBit32));
            Instruction::new(Op::Decorate, None, None, operands)
        };
        let offset = vec![
            Operand::IdRef(self.structure),
            Operand::LiteralBit32(0),
            Operand::Decoration(Decoration::Offset),
            Operand::LiteralBit32(0),
        ];
        vec![
            decorate(self.array, Decoration::ArrayStride, Some(4)),
            decorate(self.structure, Decoration::Block, None),
            Instruction::new(Op::MemberDecorate, None, None, offset),
            decorate(self.buffer, Decoration::DescriptorSet, Some(0)),
            decorate(self.buffer, Decoration::Binding, Some(Slot::Counters as u32)),
            // Modules that count steps have the same buffer under another name.
            decorate(self.buffer, Decoration::Aliased, None),
        ]
    }

    fn declarations(&self) -> Vec<Instruction> {
        let made = |opcode, id, operands| Instruction::new(opcode, None, Some(id), operands);
        let pointer = |id, class, to| made(Op::TypePointer, id, vec![Operand::StorageClass(class), Operand::IdRef(to)]);
        let (shared, private) = (StorageClass::StorageBuffer, StorageClass::Private);
        let mut list = vec![];
        if let (bool, true) = self.bool {
            list.push(made(Op::TypeBool, bool, vec![]));
        }
        let constant = |(value, id): (&u32, &u32)| {
            Instruction::new(Op::Constant, Some(self.uint), Some(*id), vec![Operand::LiteralBit32(*value)])
        };
        list.extend(self.constants.iter().map(constant));
        list.extend([
            made(Op::TypeRuntimeArray, self.array, vec![Operand::IdRef(self.uint)]),
            made(Op::TypeStruct, self.structure, vec![Operand::IdRef(self.array)]),
            pointer(self.of_structure, shared, self.structure),
            pointer(self.of_word, shared, self.uint),
            pointer(self.of_own, private, self.uint),
        ]);
        let variable = |kind, id, operands| Instruction::new(Op::Variable, Some(kind), Some(id), operands);
        list.push(variable(self.of_structure, self.buffer, vec![Operand::StorageClass(shared)]));
        let zero = Operand::IdRef(self.constant(0));
        list.extend(self.own.map(|id| variable(self.of_own, id, vec![Operand::StorageClass(private), zero.clone()])));
        list
    }

    fn constant(&self, value: u32) -> u32 {
        // Every value that occurs was given one.
        self.constants.get(&value).copied().unwrap_or(0)
    }

    /// Adds what a block does to the invocation's sums.
    fn count(&self, ids: &mut Ids, work: Work) -> Vec<Instruction> {
        let mut list = vec![];
        for (own, sum) in self.own.into_iter().zip(work.sums()).filter(|(_, sum)| *sum > 0) {
            let [before, after] = [(); 2].map(|()| ids.next());
            list.push(made(Op::Load, self.uint, before, &[own]));
            list.push(made(Op::IAdd, self.uint, after, &[before, self.constant(sum as u32)]));
            list.push(Instruction::new(Op::Store, None, None, vec![Operand::IdRef(own), Operand::IdRef(after)]));
        }
        list
    }

    /// Adds the invocation's sums to the buffer's: low words first, high ones get what those carry.
    fn flush(&self, ids: &mut Ids) -> Vec<Instruction> {
        let (zero, one) = (self.constant(0), self.constant(1));
        // The scope of the atomics is the device, their semantics are relaxed.
        let (scope, relaxed) = (one, zero);
        let mut list = vec![];
        for (own, place) in self.own.into_iter().zip((self.first..).step_by(2)) {
            let [sum, low, high, old, new, over, carry, last] = [(); 8].map(|()| ids.next());
            let word = |id, place| made(Op::AccessChain, self.of_word, id, &[self.buffer, zero, self.constant(place)]);
            list.extend([
                made(Op::Load, self.uint, sum, &[own]),
                word(low, place),
                word(high, place + 1),
                made(Op::AtomicIAdd, self.uint, old, &[low, scope, relaxed, sum]),
                made(Op::IAdd, self.uint, new, &[old, sum]),
                made(Op::ULessThan, self.bool.0, over, &[new, old]),
                made(Op::Select, self.uint, carry, &[over, one, zero]),
                made(Op::AtomicIAdd, self.uint, last, &[high, scope, relaxed, carry]),
            ]);
        }
        list
    }
}

/// An instruction with a result whose operands are ids.
fn made(opcode: Op, kind: u32, result: u32, operands: &[u32]) -> Instruction {
    let operands = operands.iter().map(|id| Operand::IdRef(*id)).collect();
    Instruction::new(opcode, Some(kind), Some(result), operands)
}

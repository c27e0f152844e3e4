//! A dispatch as a script for [Amber](https://github.com/google/amber), in the grammar of its docs/amber_script.md.

use super::Dispatch;
use crate::shared::Slot;
use std::fmt::Write;

/// The script of a dispatch with so many workgroups across and down, after `about` as a comment. It expects what was
/// recorded; in comments only, where bits are not what the test asks for.
pub fn script(dispatch: &Dispatch, [columns, rows]: [u32; 2], about: &str, bits: bool) -> String {
    let mut text = String::from("#!amber\n");
    about.lines().for_each(|line| push(&mut text, format_args!("# {line}")));
    // Bytes; Amber takes white space before END for another number, without end.
    push(&mut text, format_args!("\nSHADER compute kernel SPIRV-HEX"));
    for (i, byte) in dispatch.spirv.iter().enumerate() {
        let separator = match i {
            0 => "",
            _ if i % 16 == 0 => "\n",
            _ => " ",
        };
        let _ = write!(text, "{separator}0x{byte:02x}");
    }
    text.push_str("END\n\n");

    data(&mut text, "step", bytemuck::bytes_of(&dispatch.step));
    let held = |slot: Slot| dispatch.before.iter().find(|(held, _)| *held == slot);
    for &slot in Slot::ALL {
        // A kernel may mention a slot that these features do not use; a binding must be there all the same.
        data(&mut text, slot.name(), held(slot).map_or(&[0; 4], |(_, bytes)| bytes));
    }
    for (slot, after) in dispatch.written() {
        data(&mut text, &format!("{}_after", slot.name()), after);
    }

    push(&mut text, format_args!("\nPIPELINE compute dispatch"));
    text.push_str("  ATTACH kernel ENTRY_POINT main");
    for (id, value) in dispatch.constants() {
        let _ = write!(text, " SPECIALIZE {id} AS uint32 {value}");
    }
    push(&mut text, format_args!("\n  BIND BUFFER step AS push_constant"));
    for &slot in Slot::ALL {
        let (name, binding) = (slot.name(), slot as u32);
        push(&mut text, format_args!("  BIND BUFFER {name} AS storage DESCRIPTOR_SET 0 BINDING {binding}"));
    }
    push(&mut text, format_args!("END\n\nRUN dispatch {columns} {rows} 1\n"));
    let mark = if bits { "" } else { "# " };
    for (slot, _) in dispatch.written() {
        push(&mut text, format_args!("{mark}EXPECT {0} EQ_BUFFER {0}_after", slot.name()));
    }
    text
}

fn push(text: &mut String, line: std::fmt::Arguments) {
    let _ = writeln!(text, "{line}");
}

/// A buffer of whole words.
fn data(text: &mut String, name: &str, bytes: &[u8]) {
    push(text, format_args!("BUFFER {name} DATA_TYPE uint32 DATA"));
    for line in bytes.chunks(64) {
        let words: Vec<String> = bytemuck::pod_collect_to_vec::<u8, u32>(line).iter().map(u32::to_string).collect();
        push(text, format_args!("{}", words.join(" ")));
    }
    push(text, format_args!("END"));
}

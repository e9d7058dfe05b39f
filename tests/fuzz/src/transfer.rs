//! Downloads to object 1F50h:1: expedited, in segments, and in blocks (CiA 301, 7.2.4.3), whole or disturbed.

const INDEX: [u8; 3] = [0x50, 0x1F, 1];
const ABORT: [u8; 8] = [0x80, 0x50, 0x1F, 1, 0, 0, 0, 8];

/// How a transfer ends.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    Whole,
    /// Nothing follows this frame.
    Left(u8),
    /// An abort follows this frame.
    Aborted(u8),
    /// This frame is lost.
    Lost(u8),
    /// The CRC of a block transfer is wrong.
    WrongCrc,
}

/// Sends a frame to the server; returns its answer.
type Exchange<'a> = &'a mut dyn FnMut(&[u8; 8]) -> Option<[u8; 8]>;

/// Frames of a transfer, which its ending may interrupt.
struct Sender<'a> {
    exchange: Exchange<'a>,
    ending: Ending,
    frames: usize,
}

impl Sender<'_> {
    /// Sends a frame; `None` if the transfer has ended.
    fn send(&mut self, frame: &[u8; 8]) -> Option<Option<[u8; 8]>> {
        let number = self.frames;
        self.frames += 1;
        match self.ending {
            Ending::Left(last) if number > usize::from(last) => return None,
            Ending::Aborted(last) if number > usize::from(last) => {
                (self.exchange)(&ABORT);
                return None;
            }
            Ending::Lost(lost) if number == usize::from(lost) => return Some(None),
            _ => {}
        }
        let answer = (self.exchange)(frame);
        let is_aborted = answer.is_some_and(|answer| answer[0] == 0x80);
        (!is_aborted).then_some(answer)
    }
}

fn begin(command: u8, data: [u8; 4]) -> [u8; 8] {
    let ([a, b, c], [d, e, f, g]) = (INDEX, data);
    [command, a, b, c, d, e, f, g]
}

fn frame(head: u8, data: &[u8]) -> [u8; 8] {
    let mut frame = [0; 8];
    frame[0] = head;
    frame[1..1 + data.len()].copy_from_slice(data);
    frame
}

/// Sends a part of a package to 1F50h:1.
pub fn send(kind: u8, part: &[u8], ending: Ending, exchange: Exchange) {
    let mut sender = Sender { exchange, ending, frames: 0 };
    let _ = match kind % 4 {
        0 => segments(&mut sender, part),
        1 | 2 => blocks(&mut sender, part, ending == Ending::WrongCrc),
        _ => expedited(&mut sender, part),
    };
}

fn segments(sender: &mut Sender, part: &[u8]) -> Option<()> {
    sender.send(&begin(0x21, (part.len() as u32).to_le_bytes()))?;
    let count = part.chunks(7).count();
    for (number, chunk) in part.chunks(7).enumerate() {
        let toggle = (number as u8 & 1) << 4;
        let is_last = u8::from(number + 1 == count);
        sender.send(&frame(toggle | (7 - chunk.len() as u8) << 1 | is_last, chunk))?;
    }
    Some(())
}

/// Writes four bytes at a time, a few hundred at most.
fn expedited(sender: &mut Sender, part: &[u8]) -> Option<()> {
    for chunk in part.chunks(4).take(100) {
        let mut data = [0; 4];
        data[..chunk.len()].copy_from_slice(chunk);
        sender.send(&begin(0x23 | (4 - chunk.len() as u8) << 2, data))?;
    }
    Some(())
}

fn blocks(sender: &mut Sender, part: &[u8], has_wrong_crc: bool) -> Option<()> {
    let size = (part.len() as u32).to_le_bytes();
    let mut most = sender.send(&begin(0xC6, size))??[4];
    let mut rest = part;
    let mut unused = 0;
    while !rest.is_empty() {
        let (mut answer, mut sent) = (None, 0);
        for (number, chunk) in rest.chunks(7).take(most.into()).enumerate() {
            let is_last = chunk.len() + 7 * number == rest.len();
            answer = sender.send(&frame((number as u8 + 1) | (u8::from(is_last) << 7), chunk))?;
            (unused, sent) = (7 - chunk.len(), number + 1);
        }
        // A confirmation is missing if the last segment was lost: the client then stops.
        let [_, good, next, ..] = answer?;
        if usize::from(good) > sent || good == 0 {
            return None;
        }
        rest = rest.get(7 * usize::from(good)..).unwrap_or_default();
        most = next;
    }
    let crc = crc(part) ^ u16::from(has_wrong_crc);
    let [low, high] = crc.to_le_bytes();
    sender.send(&[0xC1 | (unused as u8) << 2, low, high, 0, 0, 0, 0, 0])?;
    Some(())
}

/// CRC-16/XMODEM.
fn crc(data: &[u8]) -> u16 {
    data.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u16::from(*byte) << 8, |crc: u16, _| {
            if crc & 0x8000 == 0 { crc << 1 } else { crc << 1 ^ 0x1021 }
        })
    })
}

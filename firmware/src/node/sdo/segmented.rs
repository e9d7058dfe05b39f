//! Transfers in one frame, and in segments that are confirmed one by one (CiA 301, 7.2.4.3.3 to 7.2.4.3.6).

use super::command_bits;
use super::incoming::Incoming;
use super::outgoing::Outgoing;
use super::{Abort, Failure, NO_TRANSFER, Objects, SdoServer, Transfer};
use canopen_rs::Address;
use canopen_rs::sdo::{
    decode_data_segment, encode_data_segment, encode_download_response,
    encode_download_segment_response, encode_upload_initiate_segmented_response,
};

impl SdoServer {
    pub(super) fn begin_download(
        &mut self,
        at: Address,
        request: &[u8; 8],
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], Abort> {
        self.transfer = Transfer::None;
        let [command, _, _, _, data @ ..] = *request;
        let sized = command & command_bits::SIZED != 0;
        if command & command_bits::EXPEDITED != 0 {
            let unused = if sized { usize::from(command >> 2 & 3) } else { 0 };
            let length = data.len() - unused;
            objects.check_write(at, sized.then_some(length))?;
            objects.write(at, data.get(..length).unwrap_or_default())?;
        } else {
            let declared = sized.then_some(u32::from_le_bytes(data) as usize);
            let incoming = Incoming::begin(at, declared, &mut self.value, objects)?;
            self.transfer = Transfer::Download { incoming, toggle: false };
        }
        Ok(encode_download_response(at))
    }

    pub(super) fn download_segment(
        &mut self,
        request: &[u8; 8],
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], Failure> {
        let Transfer::Download { mut incoming, toggle } = self.transfer else {
            return Err(NO_TRANSFER);
        };
        let at = incoming.at;
        let fail = |abort| (at, abort);
        let segment = decode_data_segment(request).map_err(|_| fail(Abort::Command))?;
        if segment.toggle != toggle {
            return Err(fail(Abort::Toggle));
        }
        incoming.append(segment.data, 0, &mut self.value).map_err(fail)?;
        if segment.last {
            self.transfer = Transfer::None;
            incoming.finish(&mut self.value, objects).map_err(fail)?;
        } else {
            incoming.pass_on_full_part(&mut self.value, objects).map_err(fail)?;
            self.transfer = Transfer::Download { incoming, toggle: !toggle };
        }
        Ok(encode_download_segment_response(toggle))
    }

    pub(super) fn begin_upload(
        &mut self,
        at: Address,
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], Abort> {
        self.transfer = Transfer::None;
        let outgoing = Outgoing::begin(at, &mut self.value, objects)?;
        if (1..=4).contains(&outgoing.length) {
            let ([a, b, c, d, ..], count) = outgoing.segment(0, &self.value, objects)?;
            let [low, high] = at.index.to_le_bytes();
            let command = command_bits::UPLOAD
                | (4 - count as u8) << 2
                | command_bits::EXPEDITED
                | command_bits::SIZED;
            return Ok([command, low, high, at.subindex, a, b, c, d]);
        }
        self.transfer = Transfer::Upload { outgoing, sent: 0, toggle: false };
        Ok(encode_upload_initiate_segmented_response(at, outgoing.length as u32))
    }

    pub(super) fn upload_segment(
        &mut self,
        asked: bool,
        objects: &mut impl Objects,
    ) -> Result<[u8; 8], Failure> {
        let Transfer::Upload { outgoing, sent, toggle } = self.transfer else {
            return Err(NO_TRANSFER);
        };
        let fail = |abort| (outgoing.at, abort);
        if asked != toggle {
            return Err(fail(Abort::Toggle));
        }
        let (data, count) = outgoing.segment(sent, &self.value, objects).map_err(fail)?;
        let sent = sent + count;
        let last = sent == outgoing.length;
        let answer = encode_data_segment(data.get(..count).unwrap_or_default(), toggle, last)
            .map_err(|_| fail(Abort::Command))?;
        self.transfer = if last {
            Transfer::None
        } else {
            Transfer::Upload { outgoing, sent, toggle: !toggle }
        };
        Ok(answer)
    }
}

//! Reads Parquet files that may have been cut or altered, without a panic.

use std::fs::File;
use std::panic::{AssertUnwindSafe, catch_unwind};

use parquet::errors::{ParquetError, Result as ParquetResult};
use parquet::file::reader::FileReader;
use parquet::file::serialized_reader::SerializedFileReader;

/// Opens a file after checking that its footer places every column chunk inside the file.
pub(crate) fn open(file: File) -> ParquetResult<SerializedFileReader<File>> {
    let length = file.metadata()?.len();
    let reader = guarded(|| SerializedFileReader::new(file))?;
    for group in reader.metadata().row_groups() {
        let is_listed = group.num_columns() == reader.metadata().file_metadata().schema_descr().num_columns();
        let chunks_lie_inside = group.columns().iter().all(|chunk| {
            let offsets = [Some(chunk.data_page_offset()), chunk.dictionary_page_offset()];
            let start = offsets.into_iter().flatten().min().unwrap_or(0);
            let end = start.checked_add(chunk.compressed_size());
            let is_inside = start >= 0 && chunk.compressed_size() >= 0;
            is_inside && end.is_some_and(|end| end as u64 <= length) && chunk.num_values() == group.num_rows()
        });
        if !(is_listed && group.num_rows() >= 0 && chunks_lie_inside) {
            return Err(ParquetError::General("its footer does not fit the file".to_owned()));
        }
    }
    Ok(reader)
}

/// The result of `read`; a panic of the decoder, which assumes intact files, becomes an error.
pub(crate) fn guarded<T>(read: impl FnOnce() -> ParquetResult<T>) -> ParquetResult<T> {
    let broken = |_| Err(ParquetError::General("its pages are not as they were written".to_owned()));
    catch_unwind(AssertUnwindSafe(read)).unwrap_or_else(broken)
}
